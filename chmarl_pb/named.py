"""What users name as ``module:name``."""

import sys
from pathlib import Path
from pkgutil import resolve_name
from typing import Any


def import_named(path: str) -> Any:
    """Return what ``module:name`` stands for; modules are also found in the current folder.

    Raises:
        ImportError, AttributeError, ValueError: there is none.
    """
    if "" not in sys.path and str(Path.cwd()) not in sys.path:
        sys.path.insert(0, str(Path.cwd()))  # as `python -m` has it; console scripts do not
    return resolve_name(path)
