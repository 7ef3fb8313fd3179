"""Our observations in Stable-Baselines3: its features extractor, and frozen features in the place of pictures."""

from typing import Any, cast

import numpy as np
import torch
from gymnasium import spaces
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper
from torch import Tensor

from chmarl_pb.learning.networks import DictEncoder
from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.networks.kept_features import feature_space
from chmarl_pb.learning.networks.numbers import Numbers
from chmarl_pb.learning.observation_keys import GOAL, is_goal
from chmarl_pb.learning.sb3.checks import Check

_IMAGE = "image"  # end of the keys of pictures


class HouseholdFeatures(BaseFeaturesExtractor):
    """Encodes observations by :func:`chmarl_pb.learning.networks.encoders.build_encoder`.

    Needs ``normalize_images=False``: SB3 turns all numbers into floats, which the encoder takes back to ids, and
    would scale pictures, which the encoder does itself.
    """

    def __init__(
        self,
        observation_space: spaces.Dict,
        features_dim: int = 128,
        graph_pool: str = "mean",
        numbers_past: bool = False,
        image_encoder: str = "cnn",
    ):
        """Make the encoder of a space.

        Args:
            observation_space: as the environment gives it.
            features_dim: features that all is encoded to.
            graph_pool: see :func:`chmarl_pb.learning.networks.encoders.build_encoder`.
            numbers_past: whether ``messages``, ``self`` and the bits of ``goal`` go past the encoder to the heads, too.
            image_encoder: of pictures; the name of the frozen network where its features are in their place.

        Raises:
            ValueError: observations are flattened, stacked, normalised or scaled.
        """
        check = Check(observation_space)
        encoder = DictEncoder(observation_space, features_dim, image_encoder, graph_pool, numbers_past)
        super().__init__(observation_space, encoder.size)
        self.encoder, self._check = encoder, check

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        self._check(observations)
        features: Tensor = self.encoder(observations)
        return features


class GoalFeatures(BaseFeaturesExtractor):
    """Nothing but numbers: ``messages``, ``self``, and whether what the instruction asks for is in view.

    The graph, the words and the picture are left out. These few numbers carry a policy without memory further in
    minutes than an encoder does in hours.
    """

    def __init__(self, observation_space: spaces.Dict):
        """Find the numbers in a space.

        Raises:
            ValueError: the goal is not observed, or observations are flattened, stacked, normalised or scaled.
        """
        check = Check(observation_space, GOAL)
        if not any(is_goal(key, space) for key, space in observation_space.items()):
            raise ValueError(f"{observation_space} has no {GOAL!r}; make the environment with goal=True")
        numbers = Numbers(observation_space)
        super().__init__(observation_space, numbers.size)
        self.numbers, self._check = numbers, check

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        """Return (B, size)."""
        self._check(observations)
        features: Tensor = self.numbers(observations)
        return features


class FeatureVecEnv(VecEnvWrapper):
    """Environments whose pictures are replaced by features of a frozen encoder, computed for all at once."""

    def __init__(self, venv: VecEnv, encoder: FrozenEncoder):
        """Wrap environments.

        Raises:
            ValueError: their observations are not Dicts.
        """
        space = venv.observation_space
        if not isinstance(space, spaces.Dict):
            raise ValueError(f"{space} is not a Dict of observations")
        super().__init__(venv, observation_space=feature_space(space, encoder))
        self.encoder = encoder

    def reset(self) -> dict[str, np.ndarray]:
        """Reset all environments."""
        return encoded(cast(dict[str, np.ndarray], self.venv.reset()), self.encoder)

    def step_wait(self) -> tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]:
        """Return what came of the step."""
        observations, rewards, ends, infos = self.venv.step_wait()
        for info in infos:
            if "terminal_observation" in info:
                info["terminal_observation"] = encoded(info["terminal_observation"], self.encoder)
        return encoded(cast(dict[str, np.ndarray], observations), self.encoder), rewards, ends, infos


def encoded(observation: dict[str, np.ndarray], encoder: FrozenEncoder) -> dict[str, np.ndarray]:
    """Return observations with features (..., *shape) float16 in the place of pictures.

    Args:
        observation: key -> array; one observation or a batch.
        encoder: computes the features.
    """
    keys = [key for key in observation if key.endswith(_IMAGE)]
    pictures = np.stack([observation[key] for key in keys])
    features = encoder(torch.from_numpy(pictures.reshape(-1, *pictures.shape[-3:]))).numpy()
    return observation | dict(zip(keys, features.reshape(*pictures.shape[:-3], *encoder.shape), strict=True))
