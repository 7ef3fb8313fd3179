"""What a run changes of the environments: the keys that are observed, and the size of the rewards."""

from collections.abc import Collection
from typing import Any

import numpy as np
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from chmarl_pb.learning.observation_keys import named

Step = tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]


class SelectedKeys(VecEnvWrapper):
    """Environments of which some keys are observed: what no network reads need not be kept in buffers."""

    def __init__(self, venv: VecEnv, names: Collection[str]):
        """Wrap environments.

        Args:
            venv: with Dict observations.
            names: of the keys, which may have a robot's name before them.
        """
        space = venv.observation_space
        assert isinstance(space, spaces.Dict)
        kept = {key: part for key, part in space.items() if named(key, *names)}
        super().__init__(venv, observation_space=spaces.Dict(kept))
        self._keys = tuple(kept)

    def reset(self) -> dict[str, np.ndarray]:
        """Reset all environments."""
        return self._selected(self.venv.reset())

    def step_wait(self) -> Step:
        """Return what came of the step."""
        observations, rewards, ends, infos = self.venv.step_wait()
        for info in infos:
            if "terminal_observation" in info:
                info["terminal_observation"] = self._selected(info["terminal_observation"])
        return self._selected(observations), rewards, ends, infos

    def _selected(self, observation: Any) -> dict[str, np.ndarray]:
        return {key: observation[key] for key in self._keys}


class ScaledRewards(VecEnvWrapper):
    """Environments whose rewards are multiplied; what is inside, as a monitor, has them as they are."""

    def __init__(self, venv: VecEnv, factor: float):
        """Wrap environments."""
        super().__init__(venv)
        self.factor = np.float32(factor)

    def reset(self) -> Any:
        """Reset all environments."""
        return self.venv.reset()

    def step_wait(self) -> Step:
        """Return what came of the step."""
        observations, rewards, ends, infos = self.venv.step_wait()
        return observations, rewards * self.factor, ends, infos
