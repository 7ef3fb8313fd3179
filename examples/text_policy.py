"""A policy that reads and answers with words: put a language model in the place of `answer`.

python examples/text_policy.py [TASK], or
chmarl-pb evaluate --policy examples.text_policy:TextPolicy --observation text
"""

import re
import sys
from typing import Any

import chmarl_pb
from chmarl_pb.sensing.text import from_bytes
from chmarl_pb.tasks.language import parse_instruction


def answer(text: str, tried: list[str]) -> str:
    """Return one of the actions that a text offers; ``tried`` is what this robot has done so far.

    A few rules: pick or place what is in sight, go where messages say, else look around in one room after the other.
    """
    actions: list[str] = re.findall(r"Actions: (.*)\.", text)[0].split(", ")
    rooms = [action for action in actions if action.startswith("goto_")]
    item, target = (name.replace("_", " ") for name in parse_instruction(text.splitlines()[0].removeprefix("Task: ")))
    holding = "You hold" in text
    wanted, verb = (target, "place") if holding else (item, "pick")
    seen = " ".join(line for line in text.splitlines() if line.startswith("You see"))
    if verb in actions and re.search(rf"[:,] {wanted}\b", seen) and tried[-1:] != [verb]:
        return verb
    message = re.search(rf"^{'Where' if holding else 'What'} .* has been seen in the ([\w ]+)", text, re.MULTILINE)
    if message and f"in the {message[1]}." not in text.splitlines()[1]:
        return f"goto_{message[1].split(' and ')[0]}"
    turns = tried.count("turn_left")
    if "turn_left" in actions and turns % 12 < 11:
        return "turn_left"
    return rooms[len(tried) // 12 % len(rooms)] if "turn_left" in actions else rooms[len(tried) % len(rooms)]


class TextPolicy:
    """Plays each robot by its text alone."""

    def __init__(self, env: chmarl_pb.HouseholdEnv) -> None:
        """Remember the names of the actions."""
        self.names = env.action_names

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.tried: dict[str, list[str]] = {robot: [] for robot in self.names}

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        """Return robot -> number of the action that it answers."""
        for robot, seen in observations.items():
            self.tried[robot].append(answer(from_bytes(seen["text"]), self.tried[robot]))
        return {robot: self.names[robot].index(self.tried[robot][-1]) for robot in observations}


def main(task: str = "val-unseen-000") -> None:
    """Play one task and print what the humanoid reads and does."""
    env = chmarl_pb.parallel_env(observation="text", split="val-unseen")
    policy = TextPolicy(env)
    episode = chmarl_pb.rollout(env, policy, seed=0, task=task)
    for infos, action in zip(episode.infos, policy.tried["humanoid"], strict=False):
        print(f"{infos['humanoid']['text']}\n> {action}\n")
    print("success" if episode.success else "failure", f"after {episode.steps} steps")
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
