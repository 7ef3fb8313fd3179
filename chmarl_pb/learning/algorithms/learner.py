"""What a training run asks of a learner: all algorithms have this face, so one loop trains them all."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import nn

from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import Choose
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer


class Learner(Protocol):
    """Networks, and how they learn from a replay buffer.

    Attributes:
        algorithm: its name.
        agents: agent -> its network.
        updates: gradient steps that were taken.
    """

    algorithm: str
    agents: nn.ModuleDict
    updates: int

    def to(self, device: torch.device) -> None:
        """Move the networks to a device, before the first gradient step."""

    def choose(self, episodes: int) -> Choose:
        """Return how to act after a number of episodes, which alone decide it: steps of ``overlap`` may come before."""

    def learn(self, replay: ReplayBuffer, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that follow a rollout of episodes, and yield each with its figures."""

    def state(self) -> dict[str, Any]:
        """Return all that it needs to go on."""

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state that comes from a file."""
