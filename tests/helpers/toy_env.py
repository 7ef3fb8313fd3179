"""A small environment whose observations, ends and infos all vary; it can be made to fail."""

import os
from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

from chmarl_pb.errors import ActionError, OptionError

FAIL, DIE = 3, 4


class ToyEnv(gymnasium.Env):
    """Episodes of 1 to 6 steps; the actions ``FAIL`` and ``DIE`` raise an error and kill the process."""

    metadata = {"render_modes": ["rgb_array"]}  # noqa: RUF012

    def __init__(self, broken: bool = False):
        if broken:
            raise OptionError("this environment is broken")
        self.render_mode = "rgb_array"
        self.mood = "calm"
        self.action_space = spaces.MultiDiscrete([5, 2])
        self.observation_space = spaces.Dict(
            {"picture": spaces.Box(0, 255, (4, 4, 3), np.uint8), "self": spaces.Box(-1, 1, (3,), np.float32)}
        )

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        super().reset(seed=seed)
        self.left = int(self.np_random.integers(1, 7)) if not options else options["steps"]
        return self._observe(), {"robot": {"name": f"r{self.left}"}, "fresh": True}

    def step(self, action: np.ndarray) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        if action[0] == FAIL:
            raise ActionError("action 3 is not allowed")
        if action[0] == DIE:
            os._exit(7)
        self.left -= 1
        over = self.left <= 0
        success = over and bool(self.np_random.integers(2))
        return self._observe(), float(action[0] - action[1]), success, over and not success, self._info(over)

    def render(self) -> np.ndarray:
        return np.full((8, 8, 3), self.left, np.uint8)

    def close(self) -> None:
        self.closed = True

    def whoami(self, greeting: str = "") -> str:
        return f"{greeting}{self.np_random_seed}"

    def secret(self) -> Any:
        return lambda: None  # cannot be pickled

    def _observe(self) -> dict[str, np.ndarray]:
        return {
            "picture": self.np_random.integers(0, 256, (4, 4, 3), np.uint8),
            "self": self.np_random.uniform(-1, 1, 3).astype(np.float32),
        }

    def _info(self, over: bool) -> dict[str, Any]:
        info: dict[str, Any] = {
            "robot": {"name": "r", "seen": ("mug_1",) * self.left, "mask": np.ones(3, np.int8) * (self.left % 2)},
            "potential": float(self.left // 2),
            "count": self.left,
            "feedback": "" if self.left % 2 else "go on",
        }
        if over:
            info["episode"] = {"length": 1.5, "notes": ["a list"]}
        return info
