"""Replay of whole episodes: arrays of fixed shapes in the types of the spaces, and a bound on their memory."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from chmarl_pb.learning.components import as_row, of_each
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.spaces import LearnerInterface, Tree, check_values, stack, tree_map, zeros

GIB = 2**30


@dataclass
class Episode:
    """One played episode; T steps, T + 1 observations; agents that are gone observe zeros.

    Attributes:
        observations: T + 1 times agent -> observation.
        actions: T times agent -> its action, a number or the numbers of its components; 0 if it is gone.
        labels: T times agent -> what an expert would have done; empty if there is none.
        action_mask: T + 1 times agent -> (K, A) bool.
        states: T + 1 times (S).
        rewards: T times (N).
        acted: T times (N) bool.
        terminated: T times (N) bool.
        info: the last infos.
    """

    observations: list[dict[str, Tree]] = field(default_factory=list)
    actions: list[dict[str, Any]] = field(default_factory=list)
    labels: list[dict[str, Any]] = field(default_factory=list)
    action_mask: list[dict[str, np.ndarray]] = field(default_factory=list)
    states: list[np.ndarray] = field(default_factory=list)
    rewards: list[np.ndarray] = field(default_factory=list)
    acted: list[np.ndarray] = field(default_factory=list)
    terminated: list[np.ndarray] = field(default_factory=list)
    info: dict[str, dict[str, Any]] = field(default_factory=dict)

    def __getstate__(self) -> dict[str, Any]:
        """Return what is sent to another process: one array of each kind for all steps.

        The arrays of single steps are thousands in a rollout, and take four times as long to be written.
        """
        return {**vars(self), **{name: stack(steps) for name in _STACKED if (steps := getattr(self, name))}}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take the steps out of what was sent."""
        vars(self).update(state)
        vars(self).update({name: _steps(state[name]) for name in _STACKED})

    def __len__(self) -> int:
        """Return the number of steps."""
        return len(self.actions)

    @property
    def episode_return(self) -> float:
        """The sum of the rewards, averaged over the agents that act."""
        acted, rewards = np.array(self.acted), np.array(self.rewards)
        return float(((rewards * acted).sum(axis=1) / acted.sum(axis=1).clip(min=1)).sum())


_STACKED = ("observations", "action_mask", "states", "rewards", "acted", "terminated")


def _steps(tree: Any) -> list[Any]:
    """Return the trees of which :func:`chmarl_pb.learning.spaces.stack` has made one."""
    if not isinstance(tree, dict):
        return [tree[step, ...] for step in range(len(tree))]
    columns = [_steps(part) for part in tree.values()]
    return [dict(zip(tree, step, strict=True)) for step in zip(*columns, strict=True)]


class ReplayBuffer:
    """Keeps the newest episodes and draws batches of them.

    Attributes:
        capacity: most episodes that are kept.
        added: episodes that were added in all.
    """

    def __init__(
        self,
        interface: LearnerInterface,
        horizon: int,
        capacity: int,
        memory_gib: float,
        device: torch.device | None = None,
    ):
        """Reserve memory; pages that are never written take none.

        Args:
            interface: of the environment.
            horizon: most steps of an episode.
            capacity: most episodes.
            memory_gib: bound of the memory; shortens ``capacity``.
            device: that batches are moved to; the buffer itself stays in main memory.

        Raises:
            ValueError: not even one episode fits.
        """
        self.horizon, self._interface, self._device = horizon, interface, device
        self.episode_bytes = sum(array.nbytes for array in leaves(self._arrays(1)))
        self.capacity = min(capacity, int(memory_gib * GIB / self.episode_bytes))
        if self.capacity < 1:
            raise ValueError(
                f"memory_gib={memory_gib}: one episode takes {self.episode_bytes / GIB:.2g} GiB; give more"
            )
        self._kept = self._arrays(self.capacity)
        self.added = 0

    def __len__(self) -> int:
        """Return the number of episodes that are kept."""
        return min(self.added, self.capacity)

    def add(self, episode: Episode) -> None:
        """Keep an episode, in the place of the oldest if there is no other.

        Raises:
            ValueError: it has more steps than ``horizon``, or observations that their space does not hold.
        """
        steps = len(episode)
        if steps > self.horizon:
            raise ValueError(f"an episode has {steps} steps, more than horizon={self.horizon}; give a longer horizon")
        place, kept = self.added % self.capacity, self._kept
        for name, counts in self._interface.actions.items():
            seen = stack([observation[name] for observation in episode.observations])
            check_values(name, kept["observations"][name], seen)
            tree_map(lambda array, new: _write(array, place, new), kept["observations"][name], seen)
            _write(kept["actions"][name], place, np.array([action[name] for action in episode.actions]))
            labels = [label.get(name, -1) for label in episode.labels] or [-1] * steps
            _write(kept["labels"][name], place, np.array([as_row(label, counts, -1) for label in labels]))
            _write(kept["action_mask"][name], place, np.array([mask[name] for mask in episode.action_mask]))
        for key in ("states", "rewards", "acted", "terminated"):
            _write(kept[key], place, np.array(getattr(episode, key)))
        kept["steps"][place] = steps
        self.added += 1

    def sample(self, count: int, rng: np.random.Generator, newest: int | None = None) -> Batch:
        """Draw different episodes (all, if there are fewer), cut to the longest of them.

        Args:
            count: number of episodes.
            rng: of the choice.
            newest: how many of the episodes that were added last can be drawn; None: all that are kept.
        """
        among = len(self) if newest is None else min(newest, len(self))
        first = 0 if newest is None else self.added - among
        chosen = (first + rng.choice(among, min(count, among), replace=False)) % self.capacity
        steps = int(self._kept["steps"][chosen].max())

        def cut(array: np.ndarray, length: int) -> Any:
            return torch.from_numpy(array[chosen, :length]).to(self._device)

        kept = self._kept
        return Batch(
            {name: tree_map(lambda array: cut(array, steps + 1), tree) for name, tree in kept["observations"].items()},
            {name: cut(array, steps).long() for name, array in kept["actions"].items()},
            {name: cut(array, steps + 1) for name, array in kept["action_mask"].items()},
            cut(kept["states"], steps + 1), cut(kept["rewards"], steps), cut(kept["acted"], steps),
            cut(kept["terminated"], steps), {name: cut(array, steps).long() for name, array in kept["labels"].items()},
        )  # fmt: skip

    def state(self) -> dict[str, Any]:
        """Return the episodes that are kept, as tensors that share the buffer's memory."""
        used = len(self)
        return {"added": self.added, "kept": tree_map(lambda array: torch.from_numpy(array[:used]), self._kept)}

    def restore(self, state: dict[str, Any]) -> None:
        """Go on from a state of a buffer of the same kind."""
        self.added = state["added"]
        for array, new in zip(leaves(self._kept), leaves(state["kept"]), strict=True):
            array[: len(new)] = new.numpy().reshape(-1, *array.shape[1:])  # older files have no axis of components

    def _arrays(self, capacity: int) -> dict[str, Any]:
        io, steps = self._interface, self.horizon
        agents, sizes = len(io.agents), {name: of_each(counts) for name, counts in io.actions.items()}
        return {
            "observations": {name: zeros(space, capacity, steps + 1) for name, space in io.observations.items()},
            "actions": {name: np.zeros((capacity, steps, len(own)), np.int16) for name, own in sizes.items()},
            "labels": {name: np.zeros((capacity, steps, len(own)), np.int16) for name, own in sizes.items()},
            "action_mask": {
                name: np.ones((capacity, steps + 1, len(own), max(own)), bool) for name, own in sizes.items()
            },
            "states": np.zeros((capacity, steps + 1, io.state_size), np.float32),
            "rewards": np.zeros((capacity, steps, agents), np.float32),
            "acted": np.zeros((capacity, steps, agents), bool),
            "terminated": np.zeros((capacity, steps, agents), bool),
            "steps": np.zeros(capacity, np.int32),
        }


def leaves(tree: Any) -> list[Any]:
    """Return the arrays of a nested dict, in order."""
    return [leaf for part in tree.values() for leaf in leaves(part)] if isinstance(tree, dict) else [tree]


def _write(array: np.ndarray, place: int, new: np.ndarray) -> None:
    """Write an episode's steps, and zeros over what an older episode left behind them."""
    array[place, : len(new)] = new.reshape(-1, *array.shape[2:])
    array[place, len(new) :] = 0
