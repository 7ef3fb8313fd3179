"""A language model plays from text: any server with the chat interface that llama.cpp, vLLM and Ollama share.

python examples/language_model.py http://localhost:8080 [MODEL [TASK]]

Evaluated: LM_URL=http://localhost:8080 chmarl-pb evaluate --policy examples.language_model:LanguageModel
--observation text --split val-unseen --seeds 1
"""

import json
import os
import re
import sys
from typing import Any
from urllib.request import Request, urlopen

import chmarl_pb
from chmarl_pb.sensing.text import from_bytes

RULES = """You drive one robot of a team that brings an object to a piece of furniture. Answer with one of the
actions that are offered, and nothing else. Look around by turning, go to rooms that messages name, pick or place
what you see."""
REMEMBERED = 6  # own actions that the model is told


class LanguageModel:
    """Asks the server what each robot should do."""

    deterministic = True

    def __init__(self, env: Any) -> None:
        """Remember the names of the actions, and where the server is."""
        self.names = env.action_names
        self.url, self.model = os.environ.get("LM_URL", "http://localhost:8080"), os.environ.get("LM_MODEL", "default")

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.done: dict[str, list[str]] = {robot: [] for robot in self.names}

    def act(self, observations: Any, infos: Any) -> dict[str, int]:
        """Return robot -> number of the action that the model names."""
        for robot, seen in observations.items():
            self.done[robot].append(self._ask(from_bytes(seen["text"]), self.done[robot]))
        return {robot: self.names[robot].index(self.done[robot][-1]) for robot in observations}

    def _ask(self, text: str, done: list[str]) -> str:
        """Return the first action that is offered and stands in the answer; "stay" if there is none."""
        offered = re.findall(r"Actions: (.*)\.", text)[0].split(", ")
        told = f"{text}\nYour last actions: {', '.join(done[-REMEMBERED:]) or 'none'}."
        messages = [{"role": "system", "content": RULES}, {"role": "user", "content": told}]
        question = {"model": self.model, "messages": messages, "temperature": 0, "max_tokens": 200}
        headers = {"Content-Type": "application/json"}
        request = Request(f"{self.url}/v1/chat/completions", json.dumps(question).encode(), headers)
        with urlopen(request, timeout=120) as answer:
            said = json.load(answer)["choices"][0]["message"]["content"]
        return next((word for word in re.findall(r"\w+", said) if word in offered), "stay")


def main(url: str, model: str = "default", task: str = "val-unseen-000", *, max_steps: int = 28) -> None:
    """Play one task and print what the robots do."""
    os.environ |= {"LM_URL": url, "LM_MODEL": model}
    env = chmarl_pb.parallel_env(observation="text", split="val-unseen", max_steps=max_steps)
    policy = LanguageModel(env)
    episode = chmarl_pb.rollout(env, policy, seed=0, task=task)
    print(env.instruction)
    for actions in zip(*policy.done.values(), strict=True):
        print("  ".join(f"{action:16}" for action in actions))
    print("success" if episode.success else "failure", f"after {episode.steps} steps")
    env.close()


if __name__ == "__main__":
    main(*sys.argv[1:4])
