"""Damage to files, for tests of what reads them."""

import os
from pathlib import Path
from typing import Any


def flipped(content: bytes, place: int, mask: int = 0x10) -> bytes:
    """Return bytes of which one is changed in some of its bits."""
    return content[:place] + bytes([content[place] ^ mask]) + content[place + 1 :]


class Evil:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, path: Path):
        self.path = path

    def __reduce__(self) -> Any:
        return os.system, (f"touch {self.path}",)
