"""Write all furniture models: ``python -m tools.assets.furniture [--out DIR]``.

The same sources give the same bytes. Each group module holds a few families of furniture and lists its models.
"""

import argparse
from pathlib import Path

from chmarl_pb.assets import URDF_DIR
from tools.assets import (
    furniture_bathroom,
    furniture_counters,
    furniture_decor,
    furniture_kitchen,
    furniture_lamps,
    furniture_livingroom,
    furniture_seats,
    furniture_soft,
    furniture_storage,
    furniture_tables,
)
from tools.assets.furniture_model import Model

GROUPS = (
    furniture_tables,
    furniture_storage,
    furniture_seats,
    furniture_soft,
    furniture_counters,
    furniture_kitchen,
    furniture_bathroom,
    furniture_livingroom,
    furniture_lamps,
    furniture_decor,
)

FOLDER = URDF_DIR / "furniture"


def models() -> list[Model]:
    """Return every furniture model."""
    return [model for group in GROUPS for model in group.models()]


def build(folder: Path = FOLDER) -> None:
    """Write all models into a folder and remove files of models that no longer exist."""
    (folder / "meshes").mkdir(parents=True, exist_ok=True)
    written = set()
    for model in models():
        model.write(folder)
        written |= {f"{model.name}.urdf", *(f"{stem}.obj" for stem in model.meshes)}
    for file in [*folder.glob("*.urdf"), *folder.glob("meshes/*.obj")]:
        if file.name not in written:
            file.unlink()


def main() -> None:
    """Parse the command line and build."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=FOLDER, help="folder to write into (default: %(default)s)")
    build(parser.parse_args().out)


if __name__ == "__main__":
    main()
