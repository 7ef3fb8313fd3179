"""The fixed tasks of the benchmark: one CSV file for each split, versioned in the repository."""

import csv
from functools import cache
from pathlib import Path

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import TaskError
from chmarl_pb.tasks.task import Task

#: Split -> homes that it plays in. CH-MARL, section 4: homes 6 and 7 are never seen in training.
SPLIT_HOMES = {
    "train": ("home_1", "home_2", "home_3", "home_4", "home_5"),
    "val-seen": ("home_1", "home_2", "home_3", "home_4", "home_5"),
    "val-unseen": ("home_6",),
    "test-seen": ("home_1", "home_2", "home_3", "home_4", "home_5"),
    "test-unseen": ("home_7",),
}
SPLITS = tuple(SPLIT_HOMES)

#: Number of tasks in each split. CH-MARL, section 4.
SPLIT_SIZES = {"train": 5500, "val-seen": 250, "val-unseen": 50, "test-seen": 250, "test-unseen": 50}

FIELDS = ("id", "home", "graspable", "source", "target", "seed", "optimal_steps")
FOLDER = Path(__file__).parent / "splits"


def load_tasks(split: str) -> list[Task]:
    """Return the tasks of a split in their fixed order.

    Raises:
        TaskError: there is no such split, or its file is damaged.
    """
    return list(_tasks(split))


def split_of(task_id: str) -> str | None:
    """Return the split that a task's id is of, or None for one that was drawn."""
    split = task_id.rpartition("-")[0]
    return split if split in SPLITS else None


def find_task(task_id: str) -> Task:
    """Return a task of any split by its id.

    Raises:
        TaskError: there is no such task.
    """
    split = split_of(task_id)
    for task in _tasks(split) if split else ():
        if task.id == task_id:
            return task
    raise TaskError(f"unknown task {task_id!r}; ids read like 'test-unseen-007', of the splits {', '.join(SPLITS)}")


@cache
def _tasks(split: str) -> tuple[Task, ...]:
    if split not in SPLITS:
        raise TaskError(f"unknown split {split!r}; use one of: {', '.join(SPLITS)}")
    return tuple(read_tasks(FOLDER / f"{split}.csv"))


def read_tasks(path: Path) -> list[Task]:
    """Read a task file: CSV with the columns ``FIELDS``.

    Raises:
        TaskError: the file is missing or a row cannot be used.
    """
    if not path.is_file():
        raise TaskError(f"{path}: no such task file; `chmarl-pb tasks build` makes those of the benchmark")
    try:
        reader = csv.DictReader(path.read_text(encoding="utf-8").splitlines())
    except UnicodeDecodeError as error:
        raise TaskError(f"{path}: not a text in UTF-8 ({error}); restore the file") from error
    if tuple(reader.fieldnames or ()) != FIELDS:
        raise TaskError(f"{path}: its first line is not {','.join(FIELDS)}; restore the file")
    return [_task(path, number, row) for number, row in enumerate(reader, start=2)]


def _task(path: Path, number: int, row: dict[str, str]) -> Task:
    try:
        task = Task(**{**row, "seed": int(row["seed"]), "optimal_steps": int(row["optimal_steps"])})  # type: ignore[arg-type]
        task.check(BENCHMARK)
        return task
    except (TypeError, ValueError) as error:
        raise TaskError(f"{path}: line {number}: {error}; restore the file") from error
