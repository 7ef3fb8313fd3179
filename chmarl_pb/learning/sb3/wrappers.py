"""What a run changes of the environments: the keys that are observed, frozen features for pictures, the rewards."""

from collections.abc import Callable, Collection
from functools import partial
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.networks.kept_features import feature_space
from chmarl_pb.learning.observation_keys import IMAGE, named

Arrays = dict[str, np.ndarray]
Step = tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]


def select_keys(venv: VecEnv, names: Collection[str]) -> VecEnv:
    """Return environments of which some keys are observed: what no network reads need not be kept in buffers.

    Args:
        venv: with Dict observations.
        names: of the keys, which may have a robot's name before them.
    """
    keys = named(_parts(venv).spaces, *names)
    space = spaces.Dict({key: _parts(venv)[key] for key in keys})
    return ChangedObservations(venv, space, lambda seen: {key: seen[key] for key in keys})


def encode_pictures(venv: VecEnv, encoder: FrozenEncoder) -> VecEnv:
    """Return environments whose pictures are replaced by features of a frozen encoder, computed for all at once."""
    return ChangedObservations(venv, feature_space(_parts(venv), encoder), partial(encoded, encoder=encoder))


def encoded(observation: Arrays, encoder: FrozenEncoder) -> Arrays:
    """Return observations with features (..., *shape) float16 in the place of pictures.

    Args:
        observation: key -> array; one observation or a batch.
        encoder: computes the features.
    """
    keys = named(observation, IMAGE)
    pictures = np.stack([observation[key] for key in keys])
    features = encoder(torch.from_numpy(pictures.reshape(-1, *pictures.shape[-3:]))).numpy()
    return observation | dict(zip(keys, features.reshape(*pictures.shape[:-3], *encoder.shape), strict=True))


def _parts(venv: VecEnv) -> spaces.Dict:
    assert isinstance(venv.observation_space, spaces.Dict)
    return venv.observation_space


class ChangedObservations(VecEnvWrapper):
    """Environments whose observations are changed, those at the end of episodes as well."""

    def __init__(self, venv: VecEnv, space: spaces.Dict, change: Callable[[Any], Arrays]):
        """Wrap environments.

        Args:
            venv: the environments.
            space: of the changed observations.
            change: changes those of one environment or of all.
        """
        super().__init__(venv, observation_space=space)
        self._change = change

    def reset(self) -> Arrays:
        """Reset all environments."""
        return self._change(self.venv.reset())

    def step_wait(self) -> Step:
        """Return what came of the step."""
        observations, rewards, ends, infos = self.venv.step_wait()
        for info in infos:
            if "terminal_observation" in info:
                info["terminal_observation"] = self._change(info["terminal_observation"])
        return self._change(observations), rewards, ends, infos


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
