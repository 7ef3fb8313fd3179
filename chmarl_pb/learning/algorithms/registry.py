"""Algorithm -> its learner. All learners have the same face, so one loop trains them all."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol, cast

import numpy as np
from torch import nn

from chmarl_pb.learning.algorithms.dagger import Imitator
from chmarl_pb.learning.algorithms.learner import Learner
from chmarl_pb.learning.algorithms.losses import Batch
from chmarl_pb.learning.algorithms.mappo import Mappo
from chmarl_pb.learning.config import CONFIGS, Config, ImitationConfig, MappoConfig, RunConfig
from chmarl_pb.learning.runs.collect import Choose
from chmarl_pb.learning.runs.replay_buffer import Replay
from chmarl_pb.learning.spaces import Interface


class Learning(Protocol):
    """What a training run asks of a learner.

    Attributes:
        algorithm: its name.
        agents: agent -> its network.
        updates: gradient steps that were taken.
    """

    algorithm: str
    agents: nn.ModuleDict
    updates: int

    def choose(self, episodes: int) -> Choose:
        """Return how to act after a number of episodes."""

    def learn(self, replay: Replay, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that follow a wave of episodes, and yield each with its figures."""

    def state(self) -> dict[str, Any]:
        """Return all that it needs to go on."""

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state that comes from a file."""


def make_learner(algorithm: str, interface: Interface, config: RunConfig) -> Learning:
    """Return the learner of an algorithm.

    Raises:
        ValueError: there is no such algorithm, or the settings are those of another.
    """
    if algorithm not in CONFIGS:
        raise ValueError(f"algorithm={algorithm!r} is not known; use one of: {', '.join(CONFIGS)}")
    if type(config) is not CONFIGS[algorithm]:
        raise ValueError(f"{algorithm} takes a {CONFIGS[algorithm].__name__}, not a {type(config).__name__}")
    if algorithm == "imitation":
        return Imitator(interface, cast(ImitationConfig, config))
    if algorithm == "mappo":
        return Mappo(interface, cast(MappoConfig, config))
    return Learner(algorithm, interface, cast(Config, config))
