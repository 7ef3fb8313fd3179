"""A small ParallelEnv in which one agent sees what the other has to do, and can but say it: pairs of components."""

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

CHOICES = 3


class TellingEnv(ParallelEnv):  # type: ignore[misc]
    """Two steps. The teller sees a number and says one of two symbols (a component of its own); the doer hears it.

    In the second step the doer is paid for the action that the number asks for; the teller's first action 1 is paid
    half, its action 0 is forbidden.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "telling_v0", "render_modes": [], "is_parallelizable": True}

    def __init__(self) -> None:
        self.possible_agents = ["teller", "doer"]
        self.agents: list[str] = []

    def observation_space(self, agent: str) -> spaces.Box:
        return spaces.Box(0, 1, (4,), np.float32)

    def action_space(self, agent: str) -> spaces.Space[Any]:
        return spaces.MultiDiscrete([CHOICES, 2]) if agent == "teller" else spaces.Discrete(2)

    def reset(self, seed: int | None = None, options: Any = None) -> tuple[Any, Any]:
        self.agents, self._time, self._heard = list(self.possible_agents), 0, -1
        self._wanted = int(np.random.default_rng(seed).integers(2))
        return self._observe(), self._infos()

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        pair = actions["teller"]
        assert self.action_space("teller").contains(pair) and pair[0] > 0 and isinstance(actions["doer"], int)
        right = self._time == 1 and actions["doer"] == self._wanted
        reward = float(right) + 0.5 * float(pair[0] == 1)
        self._time, self._heard = self._time + 1, int(pair[1])
        over = self._time == 2
        self.agents = [] if over else list(self.possible_agents)
        every = self.possible_agents
        return (
            self._observe(), dict.fromkeys(every, reward), dict.fromkeys(every, over), dict.fromkeys(every, False),
            self._infos(),
        )  # fmt: skip

    def _observe(self) -> dict[str, np.ndarray]:
        wanted, heard = np.eye(2, dtype=np.float32)[self._wanted], np.arange(2) == self._heard
        time = np.array([self._time, 1], np.float32)
        return {"teller": np.concatenate([wanted, time]), "doer": np.concatenate([heard.astype(np.float32), time])}

    def _infos(self) -> dict[str, dict[str, Any]]:
        return {"teller": {"action_mask": np.arange(CHOICES) > 0}, "doer": {}}


class Teller:
    """An expert that says what it sees, and does what it is told."""

    def __init__(self, env: Any):
        pass

    def reset(self, seed: int | None) -> None:
        pass

    def act(self, observations: Any, infos: Any) -> dict[str, Any]:
        said = {"teller": (1, int(observations["teller"][1])), "doer": int(observations["doer"][1])}
        return {name: said[name] for name in observations}
