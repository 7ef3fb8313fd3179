"""Where the URDF assets and the benchmark homes lie: in the wheel, or in a checkout beside it."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str) -> Path:
    """Return the packaged folder ``_assets/<name>``, or the checkout's top-level ``<name>``."""
    packaged = _PACKAGE / "_assets" / name
    return packaged if packaged.is_dir() else _PACKAGE.parent / name


URDF_DIR = _folder("urdf")
SCENES_DIR = _folder("scenes")
