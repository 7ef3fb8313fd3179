"""Which keys of an observation are the benchmark's: exact names, alone or after a robot's name and ``_``."""

from collections.abc import Collection
from typing import Any

import numpy as np
from gymnasium import spaces

from chmarl_pb.robots.file import packaged
from chmarl_pb.robots.registry import MOST, TEAM

NODE_CLASS, _, EDGES = GRAPH = ("node_class", "node_state", "edges")
INSTRUCTION, FEEDBACK, IMAGE = "instruction", "feedback", "image"
MESSAGES, SELF, GOAL, GOAL_ATTRIBUTES = "messages", "self", "goal", "goal_attributes"
NODE_COLOR, NODE_VIEW = "node_color", "node_view"
_NAMES = {*GRAPH, INSTRUCTION, FEEDBACK, IMAGE, MESSAGES, SELF, GOAL, GOAL_ATTRIBUTES, NODE_COLOR, NODE_VIEW}

_KINDS = dict.fromkeys((*TEAM, *packaged()))
_NUMBERS = ("", *(f"{number}_" for number in range(MOST)))  # where a kind repeats
#: What stands before the keys of the package's robots where all robots are seen as one.
_PACKAGED = ("", *(f"{kind}_{number}" for kind in _KINDS for number in _NUMBERS))
_MOST_IDS = 2**16  # of a table of embeddings; larger numbers are no ids


def prefixes(keys: Collection[str]) -> list[str]:
    """Return what stands before the keys of robots: nothing, or the name of one of the package or with a ``self``."""
    own = (key.removesuffix(SELF) for key in keys if key.endswith(f"_{SELF}"))
    return list(dict.fromkeys([*_PACKAGED, *own]))


def named(keys: Collection[str], *names: str) -> list[str]:
    """Return the keys that are one of these names, alone or with a robot's before it; ``force_feedback`` is not."""
    ours = {prefix + name for prefix in prefixes(keys) for name in names}
    return [key for key in keys if key in ours]


def are_of_all(keys: Collection[str]) -> bool:
    """Return whether keys are those of all robots seen as one, with a robot's name before each."""
    if not _NAMES.isdisjoint(keys):
        return False
    names_robots = any(key.startswith(prefix) for prefix in prefixes(keys) if prefix for key in keys)
    return names_robots or any(sum(key.endswith(f"_{name}") for key in keys) > 1 for name in _NAMES)


def is_ids(space: spaces.Space[Any], rank: int) -> bool:
    """Return whether a space holds ids from 0 on: whole numbers with a small upper bound, in this many dimensions."""
    return (
        isinstance(space, spaces.Box)
        and np.issubdtype(space.dtype, np.integer)
        and len(space.shape) == rank
        and not space.low.any()
        and bool((space.high < _MOST_IDS).all())
    )


def is_picture(space: spaces.Space[Any]) -> bool:
    """Return whether a space holds pictures: whole numbers up to 255, in three dimensions."""
    if not isinstance(space, spaces.Box) or len(space.shape) != 3 or space.dtype != np.uint8:
        return False
    return bool((space.high == 255).all())


def is_features(space: spaces.Space[Any]) -> bool:
    """Return whether a space holds what a frozen network makes of pictures."""
    return isinstance(space, spaces.Box) and space.dtype == np.float16


def tokens(space: spaces.Dict) -> list[str]:
    """Return the keys of words."""
    return [key for key in named(space.spaces, INSTRUCTION, FEEDBACK) if is_ids(space[key], 1)]


def goals(space: spaces.Dict) -> list[str]:
    """Return the keys that hold the classes of X and Y and whether they are in view."""
    return [key for key in named(space.spaces, GOAL) if is_ids(space[key], 1) and space[key].shape == (4,)]


def goal_attributes(space: spaces.Dict, goal: str) -> str:
    """Return the key of X's colour and Y's room that goes with that of a goal; "" if there is none."""
    key = goal.removesuffix(GOAL) + GOAL_ATTRIBUTES
    return key if key in space.spaces and is_ids(space[key], 1) and space[key].shape == (2,) else ""


def node_color(space: spaces.Dict, classes: str) -> str:
    """Return the key of the colours of the nodes whose classes are under a key; "" if there is none."""
    key = classes.removesuffix(NODE_CLASS) + NODE_COLOR
    return key if key in space.spaces and is_ids(space[key], 1) and space[key].shape == space[classes].shape else ""


def node_view(space: spaces.Dict, classes: str) -> str:
    """Return the key of where nodes whose classes are under a key are in the picture; "" if there is none."""
    key, nodes = classes.removesuffix(NODE_CLASS) + NODE_VIEW, space[classes].shape or ()
    fits = key in space.spaces and isinstance(space[key], spaces.Box) and space[key].shape == (*nodes, 3)
    return key if fits else ""


def graphs(space: spaces.Dict) -> dict[str, tuple[str, str]]:
    """Return the keys of scene graphs: that of the nodes' classes -> those of their states and of the edges.

    Only where all three are there, as the benchmark has them; parts of a graph are keys like any other.
    """
    found = {}
    for prefix in prefixes(space.spaces):
        keys = [prefix + name for name in GRAPH]
        if all(key in space.spaces for key in keys) and _is_graph(*(space[key] for key in keys)):
            found[keys[0]] = (keys[1], keys[2])
    return found


def _is_graph(classes: spaces.Space[Any], states: spaces.Space[Any], edges: spaces.Space[Any]) -> bool:
    nodes = is_ids(classes, 1) and is_ids(states, 1) and classes.shape == states.shape
    return nodes and is_ids(edges, 2) and edges.shape is not None and edges.shape[1] == 3
