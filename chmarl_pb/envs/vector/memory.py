"""The memory that the environments of a vector share: arrays with one row for each of them."""

import mmap
import tempfile
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from typing import IO, Any

import numpy as np
from gymnasium.spaces import Dict, Space

from chmarl_pb.errors import OptionError, WorkerError
from chmarl_pb.files import write_all

#: What an environment observes, and its actions.
Spaces = tuple[Space[Any], Space[Any]]

_ALIKE = "those of a vector have the same spaces"


@dataclass(frozen=True)
class Signature:
    """What each of the environments is like."""

    observation_space: Space[Any]
    action_space: Space[Any]
    metadata: dict[str, Any]
    render_mode: str | None
    max_episode_steps: int | None


def check_alike(spaces: Sequence[Spaces]) -> None:
    """Compare the spaces of the environments of a vector, in their order.

    Raises:
        OptionError: an environment has others than the first; it names the key where they differ.
    """
    first = _named(spaces[0][0])
    for number, (observations, actions) in enumerate(spaces):
        if not _are_equal(actions, spaces[0][1]):
            raise OptionError(f"environment {number} has the actions {actions}, environment 0 {spaces[0][1]}; {_ALIKE}")
        own = _named(observations)
        for key in (key for key in (*first, *own) if not _are_equal(first.get(key), own.get(key))):
            where = f"key {key!r}: {own.get(key)} in environment {number}, {first.get(key)} in environment 0"
            raise OptionError(f"environments observe unlike things, {where}; {_ALIKE}")


def _are_equal(one: Space[Any] | None, other: Space[Any] | None) -> bool:
    """Return whether two spaces are equal; of a kind of the user's that does not say so, whether their arrays are."""
    if one is None or other is None or type(one).__eq__ is not object.__eq__:
        return one == other
    return type(one) is type(other) and (one.shape, one.dtype) == (other.shape, other.dtype)


class Memory:
    """What the environments of a vector read and write: arrays with one row for each of them.

    Attributes:
        observations: key -> (count, ...); the key is "" if observations are no dictionaries.
        actions: (count, ...).
        rewards: (count,) float64.
        terminated: (count,) bool.
        truncated: (count,) bool.
    """

    def __init__(self, signature: Signature, count: int, buffer: mmap.mmap | None = None):
        """Lay the arrays out in a buffer that other processes may share, or in memory of this process alone."""
        layout = Memory.layout(signature, count)
        whole = np.zeros((), layout) if buffer is None else np.ndarray((), layout, buffer)
        self.observations = {key: whole[f"observation {key}"] for key in _parts(signature.observation_space)}
        self.actions, self.rewards = whole["actions"], whole["rewards"]
        self.terminated, self.truncated = whole["terminated"], whole["truncated"]

    @staticmethod
    def layout(signature: Signature, count: int) -> np.dtype:
        """Return the arrays as one structured type; its ``itemsize`` is the size of the memory in bytes."""
        parts = {f"observation {key}": part for key, part in _parts(signature.observation_space).items()}
        parts["actions"] = _array(signature.action_space, "actions")
        fields = [(name, part.dtype, (count, *(part.shape or ()))) for name, part in parts.items()]
        fields += [("rewards", np.dtype(np.float64), (count,))]
        fields += [(name, np.dtype(np.bool_), (count,)) for name in ("terminated", "truncated")]
        return np.dtype(fields, align=True)


def _named(space: Space[Any]) -> dict[str, Space[Any]]:
    return dict(space.spaces) if isinstance(space, Dict) else {"": space}


def _parts(space: Space[Any]) -> dict[str, Space[Any]]:
    """Return key -> space of the arrays that an observation consists of.

    Raises:
        OptionError: it is neither an array nor a flat dictionary of arrays.
    """
    parts = _named(space)
    for key, part in parts.items():
        _array(part, f"observation {key}")
    return parts


def _array(space: Space[Any], what: str) -> Space[Any]:
    """Return a space of arrays.

    Raises:
        OptionError: it is none.
    """
    if space.shape is None or space.dtype is None:
        raise OptionError(f"{what}: {space} is not an array of one shape; flatten it by a wrapper")
    return space


def shared_file(size: int) -> "IO[bytes]":
    """Return a new file of zeros; all of them are written, as a process ends that maps a file and finds no room for it.

    Raises:
        WorkerError: there is no room.
    """
    reasons = []
    for folder in ("/dev/shm", None):
        with ExitStack() as stack:
            try:
                file = stack.enter_context(tempfile.NamedTemporaryFile(prefix="chmarl-pb-", dir=folder))
                write_all(file.fileno(), bytes(size))
            except OSError as error:
                reasons.append(f"{folder or 'the folder of temporary files'}: {error.strerror}")
            else:
                stack.pop_all()
                return file
    raise WorkerError(
        f"no room for {size / 2**20:,.1f} MB that processes share ({'; '.join(reasons)}); make room, or use fewer "
        "environments, or workers=0"
    )
