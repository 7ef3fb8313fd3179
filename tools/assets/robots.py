"""Write the URDFs and meshes of both robots: ``python -m tools.assets.robots``; the same bytes every time."""

import argparse
from pathlib import Path

from chmarl_pb.assets import URDF_DIR
from tools.assets.robot_drone import drone
from tools.assets.robot_humanoid import humanoid
from tools.assets.robot_model import write_robot

OUT = URDF_DIR / "robots"


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
