"""Which of several ways to say a thing is taken: drawn at random, some held out of training."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np

from chmarl_pb.tasks.splits import TRAINING_SPLITS, split_of
from chmarl_pb.tasks.task import Task

T = TypeVar("T")


def may_use_held_out(task: Task) -> bool:
    """Return whether a task's words may be those held out of training: its id is one of validation or test."""
    return split_of(task.id) not in (None, *TRAINING_SPLITS)


def pick_from(ways: Sequence[T], rng: np.random.Generator) -> T:
    """Return one of them, drawn uniformly."""
    return ways[int(rng.integers(len(ways)))]
