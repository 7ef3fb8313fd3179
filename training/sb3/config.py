"""The settings of a run of Stable-Baselines3, in one place."""

import math
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from gymnasium import spaces
from sb3_contrib import RecurrentPPO
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm

from training.config import check
from training.sb3.features import HouseholdFeatures

_MEMORY = 2 * 2**30  # bytes of DQN's replay buffer, at most


@dataclass(frozen=True)
class Algorithm:
    """An algorithm and what differs from its defaults.

    Attributes:
        model: class of SB3.
        policy: name of its policy.
        settings: of the algorithm.
        network: of the policy.
    """

    model: type[BaseAlgorithm]
    policy: str
    settings: dict[str, Any]
    network: dict[str, Any]


_ON_POLICY = {"gamma": 0.97, "gae_lambda": 0.95, "ent_coef": 0.01, "learning_rate": 5e-4}
_PPO = {**_ON_POLICY, "n_steps": 64, "batch_size": 128, "n_epochs": 4}
_HEADS = {"net_arch": {"pi": [64], "vf": [64]}}

ALGORITHMS = {
    "ppo": Algorithm(PPO, "MultiInputPolicy", _PPO, _HEADS),
    "a2c": Algorithm(A2C, "MultiInputPolicy", {**_ON_POLICY, "n_steps": 16}, _HEADS),
    "dqn": Algorithm(
        DQN,
        "MultiInputPolicy",
        {
            "gamma": 0.97, "learning_rate": 3e-4, "batch_size": 64, "train_freq": 1, "gradient_steps": 2,
            "learning_starts": 2_000, "target_update_interval": 2_000, "exploration_fraction": 0.4,
        },
        {"net_arch": [64]},
    ),
    "recurrent-ppo": Algorithm(
        RecurrentPPO, "MultiInputLstmPolicy", _PPO, {**_HEADS, "lstm_hidden_size": 128, "enable_critic_lstm": True}
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Config:
    """What fixes the numbers of a run.

    Attributes:
        algo: "ppo", "a2c", "dqn" or "recurrent-ppo".
        env_id: a Gymnasium id of the benchmark.
        steps: of the environments in all.
        seed: of every random stream.
        envs: environments played side by side.
        messages: whether the robots hear each other.
        feedback: whether they get language feedback.
        image_size: pixels.
        image_encoder: "cnn" learns from pictures; others are frozen, see :mod:`training.encoders.frozen`.
        frozen: sha256 of the frozen weights; empty without them.
        features: numbers that an observation is encoded to.
        graph_pool: of scene graphs; see :func:`training.encoders.build.build_encoder`.
        learning_rate: of the optimizer; None: that of the algorithm.
        interval: steps between two validations, each with a checkpoint.
        tasks: number of validation tasks of each of the two splits.
        max_steps: of an episode.
    """

    algo: str
    env_id: str
    steps: int = 200_000
    seed: int = 0
    envs: int = 8
    messages: bool = True
    feedback: bool = True
    image_size: int = 128
    image_encoder: str = "cnn"
    frozen: str = ""
    features: int = 128
    graph_pool: str = "gated"
    learning_rate: float | None = None
    interval: int = 25_000
    tasks: int = 50
    max_steps: int = 28

    def __post_init__(self) -> None:
        """Refuse numbers that nothing can be made of; see :func:`training.config.check`."""
        check(self)

    @property
    def alone(self) -> bool:
        """Whether the humanoid is the only learner."""
        return "Humanoid" in self.env_id

    @property
    def sampled(self) -> bool:
        """Whether actions are drawn when a trained policy plays; without memory, the likeliest repeats its failures."""
        return self.algo != "dqn"

    @property
    def observation(self) -> str:
        """The benchmark's name of what is observed."""
        return "visual" if "Visual" in self.env_id else "scene_graph"

    @property
    def env_options(self) -> dict[str, Any]:
        """Keyword arguments of the environments; DQN knows single numbers as actions only."""
        shared = {name: asdict(self)[name] for name in ("messages", "feedback", "image_size", "max_steps")}
        return shared | ({"flat_actions": True} if self.algo == "dqn" and not self.alone else {})

    @property
    def policy_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of the policy's network."""
        return {
            **ALGORITHMS[self.algo].network, "features_extractor_class": HouseholdFeatures,
            "features_extractor_kwargs": {"features_dim": self.features, "graph_pool": self.graph_pool},
            "normalize_images": False,
        }  # fmt: skip

    def settings(self, space: spaces.Space) -> dict[str, Any]:
        """Return the algorithm's keyword arguments for an observation space."""
        settings = dict(ALGORITHMS[self.algo].settings)
        if self.learning_rate is not None:
            settings["learning_rate"] = self.learning_rate
        if self.algo == "dqn":
            settings["buffer_size"] = min(50_000, self.steps, _MEMORY // (2 * _size(space)))  # before and after a step
        return settings


def _size(space: spaces.Space) -> int:
    """Return the bytes of an observation."""
    parts = list(space.spaces.values()) if isinstance(space, spaces.Dict) else [space]
    return sum(math.prod(part.shape or ()) * np.dtype(part.dtype).itemsize for part in parts)
