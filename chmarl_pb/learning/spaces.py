"""Observations between environments and torch: one array for a Box or Discrete, a dict of arrays for a Dict."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from torch import nn

from chmarl_pb.learning.components import Counts, counts_in

Tree = Any  # an array or tensor, or a dict of them, as the space says

FLAT = spaces.Box | spaces.Discrete | spaces.MultiDiscrete | spaces.MultiBinary  # what observations may be made of
FLAT_NAMES = "Box, a Discrete, a MultiDiscrete, a MultiBinary"


@dataclass(frozen=True)
class Interface:
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

    def state(self, env: Any, observations: Mapping[str, Tree]) -> np.ndarray:
        """Return the global state (S), float32; agents that are gone count as zeros."""
        if self.has_state:
            return np.asarray(env.state(), dtype=np.float32).ravel()
        parts = [observations.get(name, zeros(space)) for name, space in self.observations.items()]
        return np.concatenate(
            [_flat(space, part) for space, part in zip(self.observations.values(), parts, strict=True)]
        )


def interface_of(env: Any) -> Interface:
    """Return what a learner has to know of a ParallelEnv; resets it.

    Raises:
        ValueError: its spaces are not of the kinds that can be learned from.
    """
    observations, actions = spaces_of(env)
    seen, _ = env.reset(seed=0)
    interface = Interface(observations, actions, 0, _has_state(env))
    return replace(interface, state_size=len(interface.state(env, seen)))


def spaces_of(env: Any) -> tuple[dict[str, spaces.Space[Any]], dict[str, Counts]]:
    """Return agent -> observation space, and agent -> number of actions.

    Raises:
        ValueError: an action space is neither Discrete nor MultiDiscrete, an observation space neither Box, Discrete,
            MultiDiscrete, MultiBinary nor Dict of them, or an agent has a name that torch keeps for itself.
    """
    names = list(env.possible_agents)
    for name in names:
        if "." in name or hasattr(nn.ModuleDict(), name):
            raise ValueError(f"an agent named {name!r} cannot have a network of its own in torch; give it another name")
    actions = {name: counts_in(name, env.action_space(name)) for name in names}
    observations = {name: env.observation_space(name) for name in names}
    for name, space in observations.items():
        parts = space.spaces.values() if isinstance(space, spaces.Dict) else [space]
        if not all(isinstance(part, FLAT) for part in parts):
            raise ValueError(f"the observation space of {name!r} is {space}; use a {FLAT_NAMES}, or a Dict of them")
    return observations, actions


def tree_map(function: Callable[..., Any], first: Tree, *others: Tree) -> Tree:
    """Return a tree of what a function makes of the arrays of trees of one shape."""
    if isinstance(first, Mapping):
        return {key: function(value, *(other[key] for other in others)) for key, value in first.items()}
    return function(first, *others)


def zeros(space: spaces.Space[Any], *leading: int) -> Tree:
    """Return arrays of zeros of a space's shapes and types, with leading dimensions."""
    if isinstance(space, spaces.Dict):
        return {key: zeros(part, *leading) for key, part in space.spaces.items()}
    return np.zeros((*leading, *(space.shape or ())), space.dtype)


def stack(observations: Sequence[Tree]) -> Tree:
    """Return observations of one space as one tree of arrays with a leading dimension."""
    return tree_map(lambda *arrays: np.stack([np.asarray(array) for array in arrays]), *observations)


def tensors(tree: Tree) -> Tree:
    """Return a tree of arrays as tensors that share their memory."""
    return tree_map(torch.from_numpy, tree)


def _has_state(env: Any) -> bool:
    try:
        env.state()
    except (NotImplementedError, AttributeError):
        return False
    return True


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
