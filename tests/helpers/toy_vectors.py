"""What the tests of vectors of environments share."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from tests.helpers.toy_env import ToyEnv

COUNT = 5  # environments in a vector
SAFE = (3, 2)  # actions below these do no harm

#: A test of environments that all live in this process, and of some that live in a worker.
EVERYWHERE = pytest.mark.parametrize("workers", [0, 2], ids=["in-process", "in-workers"])


def same(first: Any, second: Any) -> bool:
    """Whether two things are equal to the bit, arrays with their dtypes."""
    if isinstance(first, dict):
        return (
            isinstance(second, dict) and first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
        )
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, np.ndarray) and first.dtype == object:
        return bool(second.dtype == object and first.shape == second.shape) and all(map(same, first, second))
    if isinstance(first, np.ndarray):
        return bool(first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes())
    return type(first) is type(second) and bool(first == second)


def actions(rng: np.random.Generator, count: int = COUNT) -> np.ndarray:
    return rng.integers((0, 0), SAFE, (count, 2))


def wrapped_toy() -> gymnasium.Env:
    return gymnasium.wrappers.TimeLimit(ToyEnv(), 3)


def tame_toy() -> gymnasium.Env:
    """A toy without pictures and harmful actions."""
    env = gymnasium.wrappers.FilterObservation(ToyEnv(), ["self"])
    return gymnasium.wrappers.TransformAction(
        env, lambda action: action, gymnasium.spaces.MultiDiscrete(np.array(SAFE))
    )
