"""When learners that keep no old episodes learn, and in which parts: PQN and MAPPO."""

from collections.abc import Iterator
from typing import Protocol

import numpy as np
import torch
from torch import Tensor

from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer


class _Config(Protocol):
    @property
    def episodes(self) -> int: ...

    @property
    def envs(self) -> int: ...

    @property
    def buffer_size(self) -> int: ...

    @property
    def learning_starts(self) -> int: ...

    @property
    def batch_size(self) -> int: ...

    @property
    def n_epochs(self) -> int: ...


def most_new(config: _Config) -> int:
    """Return the most episodes that are learned from at once: whole rollouts, from ``buffer_size`` on."""
    return -(-max(config.buffer_size, config.learning_starts) // config.envs) * config.envs


def new_episodes(config: _Config, replay: ReplayBuffer, learned: int) -> int:
    """Return how many episodes are to be learned from now, after ``learned`` ones; 0 until they are enough.

    They are as soon as they are ``buffer_size``, and at the end of the run.
    """
    new = replay.added - learned
    return new if new >= config.buffer_size or replay.added >= config.episodes else 0


def minibatches(config: _Config, count: int, rng: np.random.Generator) -> Iterator[Tensor]:
    """Yield the numbers of the episodes of each gradient step: ``n_epochs`` passes over ``count`` episodes."""
    for _ in range(config.n_epochs):
        yield from torch.from_numpy(rng.permutation(count)).split(config.batch_size)


def set_learning_rates(optimizer: torch.optim.Optimizer, rates: tuple[float, ...], left: float) -> None:
    """Set the learning rate of each group of weights to a share of what it is at first."""
    for group, rate in zip(optimizer.param_groups, rates, strict=True):
        group["lr"] = rate * max(left, 0.0)
