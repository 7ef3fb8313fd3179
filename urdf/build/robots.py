"""Write the URDFs and meshes of both robots: ``python -m urdf.build.robots``; the same bytes every time."""

import argparse
from pathlib import Path

from urdf.build.robot_drone import drone
from urdf.build.robot_humanoid import humanoid
from urdf.build.robot_model import write_robot

OUT = Path(__file__).resolve().parents[1] / "robots"


def build(folder: Path = OUT) -> list[Path]:
    """Write both robots into a folder; return the paths of their URDFs."""
    return [write_robot(name, *model(), folder) for name, model in (("humanoid", humanoid), ("drone", drone))]


def main() -> None:
    """Write the humanoid and the drone."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--out", type=Path, default=OUT, help="folder to write into")
    for path in build(parser.parse_args().out):
        print(path)


if __name__ == "__main__":
    main()
