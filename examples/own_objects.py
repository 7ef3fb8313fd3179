"""Own objects and furniture: a duck and a table of PyBullet's own data, imported and played with.

python examples/own_objects.py [FOLDER]

The same from a shell, for any URDF, OBJ, STL or DAE file:

chmarl-pb things add duck.obj --class rubber_duck --up y --scale 0.05 --names "yellow duck" --out duck.png
chmarl-pb demo --home home.urdf --catalog my_things.toml
"""

import sys
from pathlib import Path

import pybullet_data

import chmarl_pb
from chmarl_pb.cli.program import main as chmarl
from chmarl_pb.tasks.task import Task

DATA = Path(pybullet_data.getDataPath())
LAYOUT = """
name = "studio"

[[room]]
name = "livingroom"
rect = [0, 0, 6, 5]
floor = "#b08050"
wall = "#f0e8d8"

[[furniture]]
room = "livingroom"
model = "workbench"
position = [2, 2.5]

[[furniture]]
room = "livingroom"
model = "sofa_two"
against = "east"
at = 2.5
"""


def main(folder: str = "out/own_objects") -> None:
    """Import two things, build a home with them, and let the planner bring one onto the other."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    catalog, layout = str(place / "my_things.toml"), place / "studio.toml"
    add = ["things", "add", "--catalog", catalog]
    chmarl([*add, str(DATA / "duck_vhacd.urdf"), "--class", "rubber_duck", "--up", "y", "--names", "yellow duck",
            "--states", "dry", "wet", "--out", str(place / "duck.png")])  # fmt: skip
    chmarl([*add, str(DATA / "table" / "table.urdf"), "--class", "workbench", "--kind", "receptacle"])
    layout.write_text(LAYOUT)
    chmarl(["homes", "build", str(layout), "--catalog", catalog])
    home = str(layout.with_suffix(".urdf"))
    env = chmarl_pb.parallel_env(home=home, catalog=catalog)
    task = Task("duck-1", home, "rubber_duck", "sofa", "workbench", seed=1)
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), task=task)
    print(env.instruction, "success" if episode.success else "failure", f"after {episode.steps} steps")
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
