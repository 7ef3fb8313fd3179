"""Where the URDF assets, the benchmark homes and trained weights lie: in the wheel, or in a checkout beside it."""

from pathlib import Path

_PACKAGE = Path(__file__).resolve().parent


def _folder(name: str, checkout: str = "") -> Path:
    """Return the packaged folder ``_assets/<name>``, or the checkout's top-level ``<name>``, or another one of it."""
    packaged = _PACKAGE / "_assets" / name
    return packaged if packaged.is_dir() else _PACKAGE.parent / (checkout or name)


URDF_DIR = _folder("urdf")
SCENES_DIR = _folder("scenes")
WEIGHTS_DIR = _folder("weights", "results/weights")
