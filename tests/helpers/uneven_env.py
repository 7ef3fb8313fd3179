"""A small ParallelEnv whose agents differ in everything: spaces, rewards, legal actions, and how long they stay."""

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv


class UnevenEnv(ParallelEnv):  # type: ignore[misc]
    """The long agent plays ``steps`` steps and is truncated; the short one terminates after two. Action 0 is illegal
    for the long agent; each agent earns its action's number plus some noise of the seed.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "uneven_v0", "render_modes": [], "is_parallelizable": True}

    def __init__(self, steps: int = 4):
        self.possible_agents = ["long", "short"]
        self.agents: list[str] = []
        self.steps, self._noise = steps, np.zeros(3, np.float32)
        self._spaces = {
            "long": spaces.Box(-10, 10, (2, 2), np.float32),
            "short": spaces.Dict({"time": spaces.Discrete(10), "noise": spaces.Box(0, 1, (3,), np.float32)}),
        }

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        return self._spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        return spaces.Discrete(3 if agent == "long" else 2)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        self._rng, self._time, self.agents = np.random.default_rng(seed), 0, list(self.possible_agents)
        return self._observe(), self._infos()

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        assert sorted(actions) == sorted(self.agents)
        assert actions["long"] > 0, "an illegal action was taken"
        self._time += 1
        there = list(self.agents)
        rewards = {name: float(actions[name] + 0.1 * self._rng.random()) for name in there}
        ended = {name: name == "short" and self._time >= 2 for name in there}
        cut = {name: name == "long" and self._time >= self.steps for name in there}
        observations, infos = self._observe(), self._infos()
        self.agents = [name for name in there if not ended[name] and not cut[name]]
        return observations, rewards, ended, cut, infos

    def _observe(self) -> dict[str, Any]:
        self._noise[:] = self._rng.random(3)  # the same array every time, as some environments have it
        seen = {
            "long": self._rng.normal(size=(2, 2)).astype(np.float32),
            "short": {"time": self._time, "noise": self._noise},
        }
        return {name: seen[name] for name in self.agents}

    def _infos(self) -> dict[str, Any]:
        infos = {"long": {"action_mask": np.array([0, 1, 1], np.int8)}, "short": {}}
        return {name: infos[name] for name in self.agents}
