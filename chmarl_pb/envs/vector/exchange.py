"""What a vector and its environments hand to each other: seeds and actions, and what comes of a reset or a step."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from chmarl_pb.envs.vector.batch import PartialAnswer
from chmarl_pb.envs.vector.engine import AnyEngine
from chmarl_pb.errors import ActionError, OptionError
from chmarl_pb.limits import whole_number

Seeds = int | Sequence[int | None] | None

#: Observations, rewards, terminated, truncated and infos of several environments.
Step = tuple[Any, np.ndarray, np.ndarray, np.ndarray, dict[str, Any]]


def seed_of_each(seed: Seeds, count: int) -> list[int | None]:
    """Return a seed for each environment: those from a number on, or those of a list.

    Raises:
        OptionError: they are not as many as the environments, or no whole numbers from 0 on.
    """
    if seed is None:
        return [None] * count
    if isinstance(seed, str) or not isinstance(seed, Sequence | np.ndarray):
        return [whole_number("seed", seed) + number for number in range(count)]
    if len(seed) != count:
        raise OptionError(f"reset got {len(seed)} seeds for {count} environments")
    return [None if one is None else whole_number("seed", one) for one in seed]


def write_actions(engine: AnyEngine, actions: Any, numbers: np.ndarray | None = None) -> None:
    """Put actions where the environments read them.

    Args:
        engine: of the environments.
        actions: one for each of them, (k, ...).
        numbers: theirs, (k,); None: of all.

    Raises:
        ActionError: the actions are not an array of the action space's shape and kind.
    """
    place = engine.memory.actions
    shape = (len(place) if numbers is None else len(numbers), *place.shape[1:])
    try:
        array = np.asarray(actions)
        if array.shape != shape:
            raise ValueError(f"its shape is {array.shape}")
        if array.dtype == bool or not np.can_cast(array.dtype, place.dtype, "same_kind"):
            raise TypeError(f"its type is {array.dtype}")
        place[slice(None) if numbers is None else numbers] = array
    except (TypeError, ValueError, RuntimeError) as error:  # the last: torch's, of tensors that require a gradient
        raise ActionError(f"actions {actions!r} are not an array {shape} of {place.dtype}: {error}") from error


def gather(engine: AnyEngine, note: Callable[[PartialAnswer], None], copy: bool = True) -> dict[str, np.ndarray]:
    """Wait until all environments have answered to a reset or a step.

    What is there is noted and copied while others are still at work, so that little is left at the end.

    Args:
        engine: of the environments.
        note: takes down how infos have changed.
        copy: whether to return arrays of their own; if not, the memory itself.

    Returns:
        key -> what the environments observe, (count, ...).
    """
    memory = engine.memory.observations
    copies = {key: np.empty_like(array) for key, array in memory.items()} if copy else dict(memory)
    for part in engine.parts():
        note(part)
        if copy:
            rows = slice(part.numbers[0], part.numbers[-1] + 1)
            for key, array in memory.items():
                copies[key][rows] = array[rows]
    return copies
