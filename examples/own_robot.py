"""A robot of one's own: an arm of PyBullet's own data on a base of one's own plays alone, and beside the others.

python examples/own_robot.py [FOLDER]

The same from a shell, once ``rover.urdf`` and ``rover.toml`` are there:

chmarl-pb evaluate --policy search --robots rover.toml,drone --split val-unseen
"""

import shutil
import sys
from pathlib import Path
from xml.etree import ElementTree

import pybullet_data

import chmarl_pb

ARM = Path(pybullet_data.getDataPath()) / "franka_panda"
ROVER = Path(__file__).parent / "rover"
MOUNT = """<joint name="mount" type="fixed">
  <parent link="base"/><child link="panda_link0"/><origin xyz="0.15 0 0.48"/>
</joint>"""
TEAMS = (("rover.toml",), ("humanoid", "drone", "rover.toml"))


def build(folder: Path) -> Path:
    """Join base and arm in one URDF, with the arm's meshes beside it, and return the path of the robot file."""
    # The arm's visual meshes have 90,000 triangles; those of its collisions look nearly the same and have 3,000. They
    # name material files that are not there.
    (folder / "meshes").mkdir(exist_ok=True)
    for file in (ARM / "meshes" / "collision").glob("*.obj"):
        lines = file.read_text().splitlines(keepends=True)
        (folder / "meshes" / file.name).write_text("".join(line for line in lines if not line.startswith("mtllib")))
    robot, arm = ElementTree.parse(ROVER / "base.urdf"), ElementTree.parse(ARM / "panda.urdf")
    robot.getroot().extend([*arm.getroot(), ElementTree.fromstring(MOUNT)])
    for mesh in robot.iter("mesh"):
        mesh.set("filename", f"meshes/{Path(mesh.get('filename', '')).name}")
    robot.write(folder / "rover.urdf")
    return Path(shutil.copy(ROVER / "rover.toml", folder))


def main(folder: str = "out/own_robot", tasks: int = 3) -> None:
    """Build the robot, and let planner and search play some tasks of homes that nobody has trained in.

    Args:
        folder: where the robot is written.
        tasks: how many, drawn by the seeds 0, 1, ...
    """
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    build(place)
    for names in TEAMS:
        robots = [str(place / name) if name.endswith(".toml") else name for name in names]
        env = chmarl_pb.parallel_env(robots=robots, split="val-unseen")
        for policy in ("planner", "search"):
            episodes = [
                chmarl_pb.rollout(env, chmarl_pb.make_policy(policy, env), seed=seed) for seed in range(tasks)
            ]  # fmt: skip
            solved = sum(episode.success for episode in episodes)
            print(f"{' + '.join(env.possible_agents)}, {policy}: {solved} of {tasks} tasks")
        env.close()


if __name__ == "__main__":
    main(sys.argv[1] if sys.argv[1:] else "out/own_robot")
