"""Which keys of an observation are the benchmark's: exact names, alone or after a robot's name and ``_``."""

from typing import Any

import numpy as np
from gymnasium import spaces

from chmarl_pb.robots.file import packaged
from chmarl_pb.robots.registry import MOST, TEAM

NODE_CLASS, _, EDGES = GRAPH = ("node_class", "node_state", "edges")
INSTRUCTION, FEEDBACK, IMAGE = "instruction", "feedback", "image"
MESSAGES, SELF, GOAL = "messages", "self", "goal"

_KINDS = dict.fromkeys((*TEAM, *packaged()))
_NUMBERS = ("", *(f"{number}_" for number in range(MOST)))  # where a kind repeats
#: What stands before the keys of the package's robots where all robots are seen as one; before others nothing is known.
PREFIXES = ("", *(f"{kind}_{number}" for kind in _KINDS for number in _NUMBERS))
_MOST_IDS = 2**16  # of a table of embeddings; larger numbers are no ids


def named(key: str, *names: str) -> bool:
    """Return whether a key is one of these names, alone or with a robot's before it; ``force_feedback`` is not."""
    return any(key == prefix + name for prefix in PREFIXES for name in names)


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
    """Return whether a space holds pictures."""
    return isinstance(space, spaces.Box) and len(space.shape) == 3 and space.dtype == np.uint8


def is_features(space: spaces.Space[Any]) -> bool:
    """Return whether a space holds what a frozen network makes of pictures."""
    return isinstance(space, spaces.Box) and space.dtype == np.float16


def is_tokens(key: str, space: spaces.Space[Any]) -> bool:
    """Return whether a key of a space holds words."""
    return named(key, INSTRUCTION, FEEDBACK) and is_ids(space, 1)


def is_goal(key: str, space: spaces.Space[Any]) -> bool:
    """Return whether a key of a space holds the classes of X and Y and whether they are in view."""
    return named(key, GOAL) and is_ids(space, 1) and space.shape == (4,)


def graphs(space: spaces.Dict) -> dict[str, tuple[str, str]]:
    """Return the keys of scene graphs: that of the nodes' classes -> those of their states and of the edges.

    Only where all three are there, as the benchmark has them; parts of a graph are keys like any other.
    """
    found = {}
    for prefix in PREFIXES:
        keys = [prefix + name for name in GRAPH]
        if all(key in space.spaces for key in keys) and _is_graph(*(space[key] for key in keys)):
            found[keys[0]] = (keys[1], keys[2])
    return found


def _is_graph(classes: spaces.Space[Any], states: spaces.Space[Any], edges: spaces.Space[Any]) -> bool:
    nodes = is_ids(classes, 1) and is_ids(states, 1) and classes.shape == states.shape
    return nodes and is_ids(edges, 2) and edges.shape is not None and edges.shape[1] == 3
