"""The fixed tasks: one CSV file for each split, versioned in the repository."""

import csv
from functools import cache
from pathlib import Path

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import HomeError, TaskError
from chmarl_pb.homes.home import Home
from chmarl_pb.reading import read_regular
from chmarl_pb.tasks.generated_homes import first_homes, numbered_homes
from chmarl_pb.tasks.task import Task

_SEEN = ("home_1", "home_2", "home_3", "home_4", "home_5")

#: The paper's splits -> homes that they play in. CH-MARL, section 4: homes 6 and 7 are never seen in training.
_BENCHMARK_HOMES = {
    "train": _SEEN,
    "val-seen": _SEEN,
    "val-unseen": ("home_6",),
    "test-seen": _SEEN,
    "test-unseen": ("home_7",),
}
BENCHMARK_SPLITS = tuple(_BENCHMARK_HOMES)

#: The split whose homes and tasks are drawn as they are needed.
STREAM = "generated"
#: Fixed splits in generated homes -> number of their homes.
GENERATED_HOMES = {"generated-val": 50, "generated-test": 100}
#: Splits in the paper's seen homes where each class of object has one place in a home, whatever the task; not of the
#: benchmark. Tasks of the last two differ from those of the first in home, object or target.
LIMITED_SPLITS = ("train-limited", "val-limited", "test-limited")
SPLITS = (*BENCHMARK_SPLITS, *GENERATED_HOMES, STREAM, *LIMITED_SPLITS)
#: Split that is trained in -> those on which its weights are chosen; limited layouts are to be known by heart, so in
#: these homes alone.
VALIDATION = {
    "train": ("val-seen", "val-unseen"),
    STREAM: ("generated-val",),
    "train-limited": ("val-limited",),
}
#: The splits on which nothing is chosen.
TEST_SPLITS = ("test-seen", "test-unseen", "generated-test", "test-limited")
#: The splits whose words are those of training.
TRAINING_SPLITS = ("train", "train-limited")

#: Number of tasks in each fixed split. CH-MARL, section 4; in generated homes enough for narrow intervals.
SPLIT_SIZES = {
    "train": 5500, "val-seen": 250, "val-unseen": 50, "test-seen": 250, "test-unseen": 50,
    "generated-val": 500, "generated-test": 2000,
    "train-limited": 5500, "val-limited": 250, "test-limited": 250,
}  # fmt: skip

FIELDS = ("id", "home", "graspable", "source", "target", "seed", "optimal_steps")
FOLDER = Path(__file__).parent / "splits"
HOMES_FILE = FOLDER / "generated-homes.sha256"


def load_tasks(split: str) -> list[Task]:
    """Return the tasks of a split in their fixed order; of "generated" none, its tasks are drawn.

    Raises:
        TaskError: there is no such split, or its file is damaged.
    """
    return list(_tasks(split))


def split_of(task_id: str) -> str | None:
    """Return the split that a task's id is of, or None for one that was drawn."""
    split, _, number = task_id.rpartition("-")
    return split if number.isdecimal() and int(number) < SPLIT_SIZES.get(split, 0) else None


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
    return () if split == STREAM else tuple(read_tasks(FOLDER / f"{split}.csv"))


@cache
def homes_of(split: str) -> tuple[str, ...]:
    """Return the homes that a split plays in; of "generated", which goes on to others, the first."""
    if split == STREAM:
        return (next(numbered_homes(0)),)
    if split in LIMITED_SPLITS:
        return _SEEN
    return _BENCHMARK_HOMES.get(split) or first_homes(split, GENERATED_HOMES[split])


@cache
def fixed_homes() -> dict[str, str]:
    """Return the generated homes that fixed tasks are played in, with the sha256 that ``Home.content`` has to be.

    There are none where the file has been removed, to build the tasks anew.

    Raises:
        TaskError: the file is damaged.
    """
    text = HOMES_FILE.read_text(encoding="utf-8") if HOMES_FILE.is_file() else ""
    rows = [line.split() for line in text.splitlines()]
    if any(len(row) != 2 for row in rows):
        raise TaskError(f"{HOMES_FILE}: a line is no sha256 with a home's name; restore the file")
    return {home: digest for digest, home in rows}


def check_fixed(name: str, home: Home) -> None:
    """Check that a home, should there be fixed tasks in it, is the one that they were made in.

    Args:
        name: by which it was asked for.
        home: what was loaded.

    Raises:
        HomeError: it is another.
    """
    expected = fixed_homes().get(name, home.content)
    if expected != home.content:
        raise HomeError(
            f"{home.path}: it is not the {name} that tasks were made in (sha256 {home.content[:12]}, not "
            f"{expected[:12]}), the generator has changed; remove {home.path.parent}, and if that does not help, use "
            "the release that the tasks are of"
        )


def read_tasks(path: Path) -> list[Task]:
    """Read a task file: CSV with the columns ``FIELDS``.

    Raises:
        TaskError: the file is missing or a row cannot be used.
    """
    if not path.is_file():
        raise TaskError(f"{path}: no such task file; `chmarl-pb tasks build` makes those of the benchmark")
    try:
        rows = read_regular(path).decode("utf-8").splitlines()
        reader = csv.DictReader(rows)
        fields = tuple(reader.fieldnames or ())
    except (ValueError, csv.Error) as error:
        raise TaskError(f"{path}: not a text in UTF-8 ({error}); restore the file") from error
    if fields != FIELDS:
        raise TaskError(f"{path}: its first line is not {','.join(FIELDS)}; restore the file")
    try:
        return [_task(path, number, row) for number, row in enumerate(reader, start=2)]
    except csv.Error as error:
        raise TaskError(f"{path}: {error}; restore the file") from error


def _task(path: Path, number: int, row: dict[str, str]) -> Task:
    try:
        task = Task(**{**row, "seed": int(row["seed"]), "optimal_steps": int(row["optimal_steps"])})  # type: ignore[arg-type]
        task.check(BENCHMARK)
        return task
    except (TypeError, ValueError) as error:
        raise TaskError(f"{path}: line {number}: {error}; restore the file") from error
