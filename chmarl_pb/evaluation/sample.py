"""Which tasks of a split an evaluation plays."""

from collections.abc import Sequence
from typing import TypeVar

from chmarl_pb.tasks.splits import TRAINING_SPLITS, load_tasks
from chmarl_pb.tasks.task import Task

T = TypeVar("T")

TRAIN_SAMPLE = 250  # of the training split the first ones are evaluated, a uniform sample over its homes


def evaluated_tasks(split: str) -> list[Task]:
    """Return the benchmark's tasks of a split that are evaluated, see :func:`sample_of`.

    Raises:
        TaskError: there is no such split, or its file is damaged.
    """
    return sample_of(split, load_tasks(split))


def sample_of(split: str, tasks: Sequence[T]) -> list[T]:
    """Return those of a split's tasks that are evaluated: all, but of those for training the first 250."""
    return [*tasks[:TRAIN_SAMPLE]] if split in TRAINING_SPLITS else [*tasks]
