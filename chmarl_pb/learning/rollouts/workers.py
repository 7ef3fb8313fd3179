"""Rollouts in several processes: each has environments and a copy of the agents, and plays a share of the episodes."""

import copy
import pickle
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from concurrent.futures import wait as wait_for
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from typing import Protocol

import numpy as np
import torch
from torch import nn

from chmarl_pb.envs.vector.sending import pickled
from chmarl_pb.learning.rollouts.collect import Choose, Collector
from chmarl_pb.learning.rollouts.replay_buffer import Episode
from chmarl_pb.processes import pools, submitted

_WAIT = 0.2  # seconds between two looks whether the run is to end


class PlayRollout(Protocol):
    """What plays a rollout: an episode for each seed, in whatever processes, each recorded as its seed stands."""

    def __call__(
        self,
        agents: nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        seeds: Sequence[int],
        meanwhile: Callable[[], None] = lambda: None,
    ) -> list[Episode]:
        """Return the episodes.

        Args:
            agents: as the next three those of :meth:`Collector.play`.
            choose: see there.
            rng: see there.
            seeds: see there.
            meanwhile: called once this process has played its share, while others may still play; it may change the
                agents.
        """


@contextmanager
def rollouts_of(
    collector: Collector,
    make: Callable[[int], Collector],
    workers: int,
    threads: int = 1,
    check: Callable[[], None] = lambda: None,
    beside: bool = False,
) -> Iterator[PlayRollout]:
    """Let a block play rollouts in several processes, of which this one is the first unless they play beside it.

    An environment plays in the same process from rollout to rollout. Each process draws its actions from a stream of
    its own, so the number of processes is part of what fixes the episodes, as the number of environments is. Other
    processes act on the CPU.

    Args:
        collector: of as many environments as a rollout has episodes; plays the first share of them, if any are played
            here.
        make: makes the collector of another process, of so many environments; sent by cloudpickle.
        workers: number of processes that play.
        threads: of torch in each.
        check: called while others are waited for; may raise an error to end the rollout.
        beside: whether all of them are others than this one, which is free for something else meanwhile.

    Raises:
        OptionError: the environment cannot be sent to other processes.
        WorkerError: one of them died, or none can be started.
    """
    others = workers if beside else workers - 1
    if not others:
        yield _Here(collector)
        return
    with pools(others, 1) as executors:
        sent = pickled(make, "the environment", _instead(beside))
        yield _Shared(collector, sent, executors, threads, check, beside)


def _instead(beside: bool) -> str:
    """Return what to do if something cannot be sent to other processes."""
    return "give workers=1 without overlap" if beside else "give workers=1"


@dataclass(frozen=True)
class _Here:
    """Plays rollouts in this process alone."""

    collector: Collector

    def __call__(
        self,
        agents: nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        seeds: Sequence[int],
        meanwhile: Callable[[], None] = lambda: None,
    ) -> list[Episode]:
        episodes = self.collector.play(agents, choose, rng, seeds, ask_experts=True)
        meanwhile()
        return episodes


@dataclass(frozen=True)
class _Shared:
    """Plays rollouts in one process of each executor and, unless they are to play beside it, in this process."""

    collector: Collector
    make: bytes
    executors: Sequence[Executor]
    threads: int
    check: Callable[[], None]
    beside: bool

    def __call__(
        self,
        agents: nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        seeds: Sequence[int],
        meanwhile: Callable[[], None] = lambda: None,
    ) -> list[Episode]:
        own = 0 if self.beside else 1  # shares that are played here
        shares = [[int(seed) for seed in share] for share in np.array_split(seeds, len(self.executors) + own)]
        streams = [int(number) for number in rng.integers(2**63, size=len(shares))]
        player = pickled((copy.deepcopy(agents).cpu(), choose), "the agents", _instead(self.beside))
        names = self.collector.interface.agents
        played = [
            submitted(executor, _play_share, self.make, self.threads, names, player, stream, share)
            for executor, stream, share in zip(self.executors, streams[own:], shares[own:], strict=True)
        ]
        episodes = [
            episode
            for stream, share in zip(streams[:own], shares[:own], strict=True)
            for episode in self.collector.play(agents, choose, np.random.default_rng(stream), share, ask_experts=True)
        ]
        meanwhile()
        return [*episodes, *chain.from_iterable(self._results(played))]

    def _results(self, futures: "Sequence[Future[list[Episode]]]") -> Iterator[list[Episode]]:
        while wait_for(futures, timeout=_WAIT).not_done:
            self.check()
        self.check()  # a signal to the whole group of processes has ended the others: that is no failure of theirs
        yield from (future.result() for future in futures)


def _play_share(
    make: bytes, threads: int, names: Sequence[str], player: bytes, stream: int, seeds: Sequence[int]
) -> list[Episode]:
    """Play episodes in this process, which is another one than that of the run.

    Raises:
        ValueError: the agents have another order here than ``names``, and so have the rewards of an episode.
    """
    torch.set_num_threads(threads)
    agents, choose = pickle.loads(player).fn
    collector = _collector(make, len(seeds))
    if (own := collector.interface.agents) != names:
        raise ValueError(
            f"possible_agents are {', '.join(names)} in one process and {', '.join(own)} in another; give them one "
            "order, which no set has"
        )
    return collector.play(agents, choose, np.random.default_rng(stream), seeds, ask_experts=True)


@lru_cache(maxsize=1)
def _collector(make: bytes, envs: int) -> Collector:
    collector: Collector = pickle.loads(make).fn(envs)  # lives as long as its process
    return collector
