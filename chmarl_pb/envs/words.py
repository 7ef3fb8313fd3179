"""Actions on a channel on which robots choose what they say: a pair of an action and a symbol, or an action alone."""

from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb.errors import ActionError
from chmarl_pb.tasks.symbols import SILENT


def action_space(actions: int, symbols: int) -> spaces.Discrete | spaces.MultiDiscrete:
    """Return the space of a robot's actions, or of its pairs of an action and a symbol if there are any symbols."""
    return spaces.MultiDiscrete([actions, symbols]) if symbols else spaces.Discrete(actions)


def numbers_in(robot: str, action: Any) -> NDArray[Any]:
    """Return a robot's action as an array.

    Raises:
        ActionError: it is none, as lists of several lengths are, and tensors that NumPy cannot read.
    """
    return as_numbers(action, f"{robot}: action")


def as_numbers(action: Any, what: str) -> NDArray[Any]:
    """Return an action as an array.

    Args:
        action: a number, numbers, an array or a tensor.
        what: it is, for messages.

    Raises:
        ActionError: it is none.
    """
    try:
        return np.asarray(action)
    except Exception as error:  # torch's of tensors that require a gradient or lie on a GPU, and others'
        raise ActionError(
            f"{what} {action!r} is not an array of numbers; give whole numbers, of a tensor those of .tolist()"
        ) from error


def action_number(robot: str, action: Any, symbols: int) -> int:
    """Return the number of an action that an environment has taken, without the symbol that goes with it.

    Args:
        robot: its name, for messages.
        action: a number, an array of one, or a pair of numbers.
        symbols: how many there are; 0: nothing can be said.
    """
    return int(numbers_in(robot, parted(robot, action, symbols)[0]).item())


def parted(robot: str, action: Any, symbols: int) -> tuple[Any, int]:
    """Return a robot's action and the symbol that it says; an action alone says nothing.

    Args:
        robot: its name, for messages.
        action: a number, or a pair of numbers.
        symbols: how many there are; 0: nothing can be said.

    Raises:
        ActionError: it is a pair where nothing can be said, or the symbol is out of range.
    """
    if not symbols or (pair := numbers_in(robot, action)).ndim == 0:
        return action, SILENT
    if pair.shape != (2,) or pair.dtype.kind not in "iu" or not 0 <= pair[1] < symbols:
        raise ActionError(
            f"{robot}: {action!r} is not an action and a symbol, whole numbers, the second below {symbols}"
        )
    return int(pair[0]), int(pair[1])
