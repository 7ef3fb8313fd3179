"""When learners that keep no old episodes learn, and in which parts: PQN and MAPPO."""

from collections.abc import Iterator

import numpy as np
import torch
from torch import Tensor

from chmarl_pb.learning.config import RunConfig


def new_episodes(config: RunConfig, played: int, learned: int) -> int:
    """Return how many of the played episodes are learned from now, after ``learned`` ones; 0 until there are enough.

    There are enough once ``buffer_size`` have come, or when the run ends.
    """
    new = played - learned
    return new if new >= config.buffer_size or played >= config.episodes else 0


def minibatches(count: int, epochs: int, size: int, rng: np.random.Generator) -> Iterator[Tensor]:
    """Yield the numbers of the episodes of each gradient step: ``epochs`` passes over ``count`` episodes."""
    for _ in range(epochs):
        yield from torch.from_numpy(rng.permutation(count)).split(size)


def set_learning_rates(optimizer: torch.optim.Optimizer, rates: tuple[float, ...], left: float) -> None:
    """Set the learning rate of each group of weights to a share of what it is at first."""
    for group, rate in zip(optimizer.param_groups, rates, strict=True):
        group["lr"] = rate * max(left, 0.0)
