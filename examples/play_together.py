"""Cooperate with a person: you drive the humanoid in the browser, a policy of one's own the drone.

python examples/play_together.py [TASK]    on the page, the drone's *Driver* is play_together:Lookout
python examples/play_together.py --rehearse    the same without a browser: the planner stands for the person
"""

import sys
from pathlib import Path
from typing import Any

from chmarl_pb.cli.program import main as chmarl

sys.path.append(str(Path(__file__).parent))  # so that play_together:Lookout is found
LOOKOUT = "play_together:Lookout"
TASK = "test-unseen-007"


class Lookout:
    """A drone that looks into one room after the other until the message board has both rooms, then stays."""

    def __init__(self, env: Any) -> None:
        """Remember the names of the actions."""
        self.names = env.action_names

    def reset(self, seed: int | None) -> None:
        """Begin with the first room again."""
        self.visited = 0

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        """Return robot -> number of its action."""
        actions = {}
        for robot, seen in observations.items():
            rooms = [number for number, name in enumerate(self.names[robot]) if name.startswith("goto_")]
            done = seen["messages"].any(axis=1).all()
            actions[robot] = self.names[robot].index("stay") if done else rooms[self.visited % len(rooms)]
            self.visited += 1
        return actions


def rehearse(task: str = TASK) -> None:
    """Play a task with the planner in the person's place, and print what happens."""
    from chmarl_pb.viewer.live.choice import Choice

    game = Choice(task).begin()
    game.hand_over("drone", LOOKOUT)
    while not game.over:
        game.choose("humanoid", game.hint()["humanoid"])
        drawn = game.step()
        print(f"humanoid {drawn.actions['humanoid']:16} drone {drawn.actions['drone']}")
    print("success" if game.file().success else "failure")
    game.close()


def main(task: str = TASK) -> None:
    """Serve the page until Ctrl-C."""
    chmarl(["play", "--policy", LOOKOUT, "--task", task])


if __name__ == "__main__":
    rehearse() if sys.argv[1:] == ["--rehearse"] else main(*sys.argv[1:])
