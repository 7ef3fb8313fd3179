"""Which tasks of a split an evaluation plays."""

from chmarl_pb.tasks.splits import TRAINING_SPLITS, load_tasks
from chmarl_pb.tasks.task import Task

TRAIN_SAMPLE = 250  # of the training split the first ones are evaluated, a uniform sample over its homes


def evaluated_tasks(split: str) -> list[Task]:
    """Return the tasks of a split that are evaluated: all, but of those for training the first 250.

    Raises:
        TaskError: there is no such split, or its file is damaged.
    """
    tasks = load_tasks(split)
    return tasks[:TRAIN_SAMPLE] if split in TRAINING_SPLITS else tasks
