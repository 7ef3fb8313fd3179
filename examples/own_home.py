"""A home of one's own: a layout, its URDF, a check, a picture, and tasks to play in it.

python examples/own_home.py [FOLDER]

The same from a shell: chmarl-pb homes new | build | check | preview, and evaluate --home.
"""

import sys
from pathlib import Path

import chmarl_pb
from chmarl_pb.cli.program import main as chmarl

TABLE = '    { room = "livingroom", model = "coffee_table_round", position = [2.5, 2.25], yaw = 0 },\n'


def main(folder: str = "out/own_home", *, tasks: int = 5) -> None:
    """Begin with the starter layout, put a table into it, build and check the home, and let the search play in it."""
    place = Path(folder)
    place.mkdir(parents=True, exist_ok=True)
    layout, home = place / "cabin.toml", place / "cabin.urdf"
    layout.unlink(missing_ok=True)
    chmarl(["homes", "new", str(layout)])
    text = layout.read_text(encoding="utf-8")
    layout.write_text(text.replace("furniture = [\n", f"furniture = [\n{TABLE}"), encoding="utf-8")
    chmarl(["homes", "build", str(layout)])
    chmarl(["homes", "check", str(home)])
    chmarl(["homes", "preview", str(home), "--out", str(place / "cabin.png")])
    env = chmarl_pb.parallel_env(home=str(home))
    policy = chmarl_pb.make_policy("search", env)
    episodes = [chmarl_pb.rollout(env, policy, seed) for seed in range(tasks)]
    print(f"search: {sum(episode.success for episode in episodes)} of {tasks} tasks")
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
