"""Observations between environments and torch: one array for a Box or Discrete, a dict of arrays for a Dict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from torch import nn

from chmarl_pb.learning.components import Counts, counts_in

Tree = Any  # an array or tensor, or a dict of them, as the space says

FLAT = spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary  # what observations may be made of
FLAT_NAMES = "Box, a Discrete, a MultiDiscrete, a MultiBinary"
_LEAVES = (np.ndarray, torch.Tensor)


@dataclass(frozen=True)
class LearnerInterface:
    """What a learner has to know of an environment.

    Attributes:
        observations: agent -> its observation space.
        actions: agent -> number of its actions, or of the values of each component of one.
        state_size: numbers in the global state.
        has_state: whether the environment has ``state()``; if not, all observations are concatenated.
    """

    observations: dict[str, spaces.Space[Any]]
    actions: dict[str, Counts]
    state_size: int
    has_state: bool

    @property
    def agents(self) -> tuple[str, ...]:
        """The names of all agents, in order."""
        return tuple(self.actions)

    @cached_property
    def _shapes(self) -> dict[str, dict[str, tuple[int, ...]]]:
        """Agent -> key of its observations, "" if they have none -> shape."""
        return {
            name: {key: part.shape or () for key, part in _parts(space).items()}
            for name, space in self.observations.items()
        }

    @cached_property
    def _ranges(self) -> dict[str, dict[str, tuple[Any, Any]]]:
        """Agent -> key of each part that is a choice -> its least and its greatest numbers."""
        return {
            name: {
                key: (part.start, part.start + (part.n if isinstance(part, spaces.Discrete) else part.nvec) - 1)
                for key, part in _parts(space).items()
                if isinstance(part, spaces.Discrete | spaces.MultiDiscrete)
            }
            for name, space in self.observations.items()
        }

    def observed(self, name: str, observation: Tree) -> Tree:
        """Return an agent's observation in arrays of its own, as environments may use theirs again.

        Raises:
            ValueError: it has not the keys and shapes of its space, or a choice that this does not have.
        """
        arrays = tree_map(np.array, observation)
        parts = arrays if isinstance(arrays, dict) else {"": arrays}
        for key, shape in self._shapes[name].items():
            found = getattr(parts.get(key), "shape", None)
            if found != shape:
                what = f"shape {found}" if found is not None else "nothing of that kind"
                raise ValueError(
                    f"{_where(name, key)} has the shape {shape} in its observation_space, but {what} in what the "
                    "environment returns; let both say the same"
                )
        for key, (least, most) in self._ranges[name].items():
            if (parts[key] < least).any() or (parts[key] > most).any():
                raise ValueError(
                    f"{_where(name, key)} is {parts[key].tolist()}, and its observation_space goes from "
                    f"{np.min(least)} to {np.max(most)}; let both say the same"
                )
        return arrays

    def state(self, env: Any, observations: Mapping[str, Tree]) -> np.ndarray:
        """Return the global state (S), float32; agents that are gone count as zeros.

        Raises:
            ValueError: ``state()`` gives no finite numbers, or not as many as after the first reset.
        """
        if self.has_state:
            state: np.ndarray = _numbers(env.state())
            if not np.isfinite(state).all():
                raise ValueError("state() has infinite values, or what is no number; return finite numbers")
            if self.state_size and len(state) != self.state_size:
                raise ValueError(
                    f"state() has {len(state)} numbers, and {self.state_size} after the first reset; give it one "
                    "length, with zeros for what is gone"
                )
            return state
        return np.concatenate(
            [
                _flat(space, observations[name]) if name in observations else np.zeros(_flat_size(space), np.float32)
                for name, space in self.observations.items()
            ]
        )


def learner_interface_of(env: Any) -> LearnerInterface:
    """Return what a learner has to know of a ParallelEnv; resets it.

    Raises:
        ValueError: its spaces are not of the kinds that can be learned from, or what it returns does not fit them.
    """
    observations, actions = spaces_of(env)
    seen, _ = two_dicts(env.reset(seed=0))
    interface = LearnerInterface(observations, actions, 0, _has_state(env))
    first = {name: interface.observed(name, seen[name]) for name in observations if name in seen}
    if not first:
        raise ValueError(
            "reset() gives no observation of any of possible_agents; return one for each agent that is there"
        )
    size = len(interface.state(env, first))
    if not size:
        raise ValueError("state() is empty; return numbers, or leave it out: all observations then take its place")
    return replace(interface, state_size=size)


def two_dicts(start: Any) -> tuple[Mapping[str, Tree], Mapping[str, Any]]:
    """Return the observations and infos that a reset has returned.

    Raises:
        ValueError: it is no pair of dicts.
    """
    if not (isinstance(start, tuple) and len(start) == 2 and all(isinstance(one, Mapping) for one in start)):
        raise ValueError(
            f"reset() returns {type(start).__name__}; return two dicts, observations and infos, as PettingZoo's "
            "ParallelEnv does (pettingzoo.utils.conversions.aec_to_parallel makes one of an AECEnv)"
        )
    observations, infos = start
    return observations, infos


def spaces_of(env: Any) -> tuple[dict[str, spaces.Space[Any]], dict[str, Counts]]:
    """Return agent -> observation space, and agent -> number of actions.

    Raises:
        ValueError: it is no ParallelEnv, an action space is neither Discrete nor MultiDiscrete, an observation space
            neither Box, Discrete, MultiDiscrete, MultiBinary nor Dict of them, or an agent has a name that torch keeps
            for itself.
    """
    if not hasattr(env, "possible_agents"):
        raise ValueError(f"{env!r} has no possible_agents: env_fn has to make a ParallelEnv, as PettingZoo has them")
    names = list(env.possible_agents)
    for name in names:
        if not isinstance(name, str) or not name or "." in name or hasattr(nn.ModuleDict(), name):
            raise ValueError(f"an agent named {name!r} cannot have a network of its own in torch; give it another name")
    actions = {name: counts_in(name, env.action_space(name)) for name in names}
    observations = {name: env.observation_space(name) for name in names}
    for name, space in observations.items():
        if not all(isinstance(part, FLAT) for part in _parts(space).values()):
            raise ValueError(f"the observation space of {name!r} is {space}; use a {FLAT_NAMES}, or a Dict of them")
        empty = [key for key, part in _parts(space).items() if not spaces.flatdim(part)]
        if empty or not _parts(space):
            raise ValueError(f"{_where(name, *empty[:1])} has no numbers in its observation_space; leave it out")
    return observations, actions


def tree_map(function: Callable[..., Any], first: Tree, *others: Tree) -> Tree:
    """Return a tree of what a function makes of the arrays of trees of one shape."""
    if not isinstance(first, _LEAVES) and isinstance(first, Mapping):  # whether it is a Mapping takes longer to tell
        return {key: tree_map(function, value, *(other[key] for other in others)) for key, value in first.items()}
    return function(first, *others)


def zeros(space: spaces.Space[Any], *leading: int) -> Tree:
    """Return arrays of zeros of a space's shapes and types, with leading dimensions."""
    if isinstance(space, spaces.Dict):
        return {key: zeros(part, *leading) for key, part in space.spaces.items()}
    return np.zeros((*leading, *(space.shape or ())), space.dtype)


def stack(observations: Sequence[Tree]) -> Tree:
    """Return observations of one space as one tree of arrays with a leading dimension."""
    return tree_map(lambda *arrays: np.array(arrays), *observations)  # a third of the time that np.stack takes


def tensors(tree: Tree) -> Tree:
    """Return a tree of arrays as tensors that share their memory."""
    return tree_map(torch.from_numpy, tree)


def check_values(name: str, kept: Tree, seen: Tree) -> None:
    """Check that arrays in the types of an agent's space hold what it has observed.

    Raises:
        ValueError: values would be cut off there, so that others were learned from than were acted on.
    """
    for key, array in kept.items() if isinstance(kept, Mapping) else [("", kept)]:
        values = seen[key] if isinstance(kept, Mapping) else seen
        if not _holds(array.dtype, values):
            raise ValueError(
                f"{_where(name, key)} is of {array.dtype} in its observation_space, which does not hold what the "
                f"environment returns, {values.dtype} from {values.min()} to {values.max()}; let both say the same"
            )


def _holds(dtype: np.dtype[Any], values: np.ndarray) -> bool:
    """Return whether values fit into a type; what floats round does not count."""
    if values.dtype == dtype:
        return True
    with np.errstate(invalid="ignore", over="ignore"):  # of what is no number, or too great
        if np.issubdtype(dtype, np.floating) and values.dtype.kind in "biuf":
            is_as_wide = values.dtype.itemsize <= dtype.itemsize
            return is_as_wide or np.array_equal(np.isinf(values.astype(dtype)), np.isinf(values))
        return np.array_equal(values.astype(dtype), values)


def _parts(space: spaces.Space[Any]) -> dict[str, spaces.Space[Any]]:
    """Return the key of each part of a space -> the part; "" if the space is one."""
    return dict(space.spaces) if isinstance(space, spaces.Dict) else {"": space}


def _where(name: str, key: str = "") -> str:
    """Return the words for a part of an agent's observations."""
    return f"the observation of {name!r}" + (f", key {key!r}," if key else "")


def _has_state(env: Any) -> bool:
    if not callable(getattr(env, "state", None)):
        return False
    try:
        env.state()
    except (NotImplementedError, AttributeError):
        return False
    return True


def _numbers(state: Any) -> np.ndarray:
    """Return a copy of a state as one vector; environments may use its array again.

    Raises:
        ValueError: it is not made of numbers.
    """
    try:
        return np.array(state, dtype=np.float32).ravel()
    except (TypeError, ValueError) as error:
        raise ValueError(f"state() returns {type(state).__name__}, not an array of numbers ({error})") from error


def _flat_size(space: spaces.Space[Any]) -> int:
    """Return the length of what ``_flat`` makes of an observation."""
    return sum(spaces.flatdim(part) for part in _parts(space).values())


def _flat(space: spaces.Space[Any], observation: Tree) -> np.ndarray:
    """Return an observation as one vector; a Discrete as one-hot."""
    if isinstance(space, spaces.Dict):
        return np.concatenate([_flat(part, observation[key]) for key, part in space.spaces.items()])
    if isinstance(space, spaces.Discrete):
        one_hot: np.ndarray = (np.arange(space.n) == observation - space.start).astype(np.float32)
        return one_hot
    if isinstance(space, spaces.MultiDiscrete):
        return np.concatenate(
            [
                np.arange(count) == number
                for count, number in zip(space.nvec.ravel(), np.ravel(observation - space.start), strict=True)
            ]
        ).astype(np.float32)
    return np.asarray(observation, dtype=np.float32).ravel()
