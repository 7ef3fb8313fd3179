"""Make the task files of the splits: drawn uniformly over what fits, solved once by the planner.

Each task is drawn from its own seed (version, split, number, attempt), so the files do not depend
on the number of processes that make them.
"""

import csv
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.errors import TaskError
from chmarl_pb.evaluation.provenance import packaged_things_hash, source_hash
from chmarl_pb.files import Lock, append_line, replacing, sealed, unsealed, write_atomically
from chmarl_pb.homes.home import load_home
from chmarl_pb.processes import check_workers, in_processes
from chmarl_pb.progress import progress_bar
from chmarl_pb.tasks.own_places import own_place
from chmarl_pb.tasks.sampling import sample_task
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.simulations import Simulations
from chmarl_pb.tasks.splits import (
    FIELDS,
    GENERATED_HOMES,
    HOMES_FILE,
    LIMITED_SPLITS,
    SPLIT_SIZES,
    SPLITS,
    homes_of,
    read_tasks,
)
from chmarl_pb.tasks.task import Task

VERSION = 1  # of the draw; a change of homes, assets or planner that changes the files raises it
_MOST_ATTEMPTS = 1000

Slot = tuple[str, int, int]  # split, number, first attempt
Kind = tuple[str, str, str, str]


class SolvedFile:
    """A side file of the tasks of a split that are solved, one line each, so that an interrupted build goes on.

    Each line has a checksum that also covers what the tasks are made by, so none counts in another version.

    Attributes:
        path: of the file; it is there once there is a task.
        solved: slot -> its attempt and task.
    """

    def __init__(self, tasks: Path, split: str):
        """Read what is solved; the caller holds the lock of the folder.

        Args:
            tasks: file of the split's tasks, beside which it lies.
            split: its name.
        """
        self.path, self.solved = tasks.with_name(f"{tasks.name}.partial"), dict[Slot, tuple[int, Task]]()
        homes = () if split in GENERATED_HOMES else homes_of(split)  # those that the source does not tell
        self._made_by = " ".join(
            [str(VERSION), split, source_hash(), packaged_things_hash(), *(load_home(home).content for home in homes)]
        )
        lines = self.path.read_bytes().splitlines() if self.path.is_file() else []
        for line in lines:
            with suppress(KeyError, TypeError, ValueError):
                row = unsealed(line.decode(), self._made_by)
                self.solved[split, row["number"], row["first"]] = row["attempt"], Task(**row["task"])
        if lines:
            write_atomically(self.path, "".join(f"{self._line(slot)}\n" for slot in self.solved))

    def _line(self, slot: Slot) -> str:
        (_, number, first), (attempt, task) = slot, self.solved[slot]
        return sealed({"number": number, "first": first, "attempt": attempt, "task": asdict(task)}, self._made_by)

    def add(self, slot: Slot, attempt: int, task: Task) -> None:
        """Write down a solved task.

        Raises:
            WriteError: the disk is full.
        """
        self.solved[slot] = attempt, task
        append_line(self.path, self._line(slot))

    def remove(self) -> None:
        """Delete it: the tasks are written."""
        self.path.unlink(missing_ok=True)


def build_all(folder: Path, workers: int) -> int:
    """Write the task files of all splits into a folder; a file that is there already is kept, as are solved tasks.

    Args:
        folder: where the CSV files go; made if it is missing.
        workers: number of processes.

    Returns:
        0.

    Raises:
        TaskError: a file that is there already has not all tasks.
        BusyError: another process writes into the folder.
        WriteError: a file cannot be written.
    """
    check_workers(workers)
    with Lock(folder / f"{SPLITS[0]}.csv"):  # the last to be written
        _build_all(folder, workers)
    return 0


def _build_all(folder: Path, workers: int) -> None:
    taken: dict[bool, set[Kind]] = {False: set(), True: set()}  # limited layouts apart: they move nothing else
    with progress_bar() as bar:
        for split in reversed(SPLIT_SIZES):  # train comes last: it gives way to what the others have
            path, kinds = folder / f"{split}.csv", taken[split in LIMITED_SPLITS]
            row = bar.add_task(split, total=SPLIT_SIZES[split])
            if path.is_file():
                tasks = read_tasks(path)
                if len(tasks) != SPLIT_SIZES[split]:
                    raise TaskError(f"{path}: {len(tasks)} tasks instead of {SPLIT_SIZES[split]}; remove it")
                kinds.update(_kind(task) for task in tasks)
            else:
                file = SolvedFile(path, split)
                tasks = build_split(split, SPLIT_SIZES[split], kinds, workers, partial(bar.advance, row), file)
                write_tasks(path, tasks)
                file.remove()
            bar.update(row, completed=len(tasks))
    homes = (home for split in GENERATED_HOMES for home in homes_of(split))
    write_atomically(folder / HOMES_FILE.name, "".join(f"{load_home(home).content}  {home}\n" for home in homes))


def build_split(
    split: str, size: int, taken: set[Kind], workers: int, progress: Callable[[int], None], file: SolvedFile
) -> list[Task]:
    """Return a split's tasks; no two of them, and none in ``taken``, share home, object, source and target.

    Of train-limited some do: with one source for each object there are not enough.

    Args:
        split: name of the split.
        size: number of tasks.
        taken: kinds of tasks that other splits have; the new ones are added.
        workers: number of processes.
        progress: called with the number of tasks that have been solved since its last call.
        file: has those that are solved already, and gets the others.
    """
    chosen: dict[int, Task] = {}
    slots: list[Slot] = [(split, number, 0) for number in range(size)]
    while slots:
        again: list[Slot] = []
        for (_, number, _), (attempt, task) in zip(slots, _solved(slots, workers, file), strict=True):
            kind = _kind(task)
            if kind in taken:
                again.append((split, number, attempt + 1))
                continue
            if split != LIMITED_SPLITS[0]:
                taken.add(kind)
            chosen[number] = task
            progress(1)
        slots = again
    return [chosen[number] for number in range(size)]


def _kind(task: Task) -> Kind:
    return task.home, task.graspable, task.source, task.target


def write_tasks(path: Path, tasks: list[Task]) -> None:
    """Write a task file, whole or not at all."""
    with replacing(path) as temporary, temporary.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows(asdict(task) for task in tasks)


def _solved(slots: list[Slot], workers: int, file: SolvedFile) -> Iterator[tuple[int, Task]]:
    """Yield attempt and task of each slot, in order."""
    left = [slot for slot in slots if slot not in file.solved]
    found = map(_solve_slot, left) if workers == 1 else in_processes(_solve_slot, left, workers, ordered=True)
    for slot in slots:
        if slot not in file.solved:
            file.add(slot, *next(found))
        yield file.solved[slot]


def _solve_slot(slot: Slot) -> tuple[int, Task]:
    """Return the first attempt of a slot that gives a solvable task, with its L*."""
    split, number, first = slot
    home = _home_of(split, number)
    simulation = _simulations().enter(home)
    for attempt in range(first, first + _MOST_ATTEMPTS):
        rng = np.random.default_rng([VERSION, SPLITS.index(split), number, attempt])
        task = sample_task(simulation.space, home, rng, f"{split}-{number:0{4 if SPLIT_SIZES[split] > 1000 else 3}d}")
        try:
            task = _from_own_place(simulation, task) if split in LIMITED_SPLITS else task
            return attempt, replace(task, optimal_steps=simulation.solve(task).steps)
        except TaskError:
            continue
    raise TaskError(f"{home}: {_MOST_ATTEMPTS} drawn tasks for {split} cannot be solved; fix the home")


def _from_own_place(simulation: Simulation, task: Task) -> Task:
    """Return a task whose source is where its object has its place.

    Raises:
        TaskError: the object has none, or it is on the target.
    """
    place = own_place(simulation.world, simulation.space, task.item)
    if place is None:
        raise TaskError(f"task {task.id!r}: {task.home} has no place for a {task.graspable}")
    return replace(task, source=catalog.class_of(place.receptacle))


def _home_of(split: str, number: int) -> str:
    """Return the home of a split's task: the homes in turn, but generated ones, which take long to make, in order."""
    homes = homes_of(split)
    place = number * len(homes) // SPLIT_SIZES[split] if split in GENERATED_HOMES else number % len(homes)
    return homes[place]


@cache
def _simulations() -> Simulations:
    return Simulations(Simulation)
