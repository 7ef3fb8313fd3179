"""Files that appear whole or not at all."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from chmarl_pb.errors import OptionError


def cache_folder() -> Path | None:
    """Return the user's folder for what can be made again, which need not exist; None if there is to be none.

    ``CHMARL_CACHE`` names it, by default ``chmarl_pb`` in the user's folder for caches; empty or "off" means none.
    """
    chosen = os.environ.get("CHMARL_CACHE")
    if chosen is not None:
        return None if chosen in ("", "off") else Path(os.path.expanduser(chosen)).absolute()
    folder = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    return folder / "chmarl_pb" if folder.is_absolute() else None


def open_folder(folder: Path) -> Path:
    """Make a folder that files can be written to, and return it.

    Raises:
        OptionError: it cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OptionError(f"{folder}: cannot write here ({error.strerror}); choose another folder") from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that takes its place at the end; nothing is left after an error.

    The folder is made if it is missing.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(prefix=f".{path.name}-", suffix=".tmp", dir=path.parent)
    os.close(handle)
    temporary = Path(name)
    try:
        yield temporary
        temporary.chmod(0o644)
        temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def write_atomically(path: Path, text: str) -> None:
    """Write a text file, whole or not at all; its folder is made if it is missing."""
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
