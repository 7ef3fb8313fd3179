"""Which task an episode plays: one that is named, one of a split, or one made up for a home."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import HomeError, TaskError
from chmarl_pb.tasks.generated_homes import EPISODES_IN_A_HOME, HomeStream
from chmarl_pb.tasks.kinds import REARRANGE, TaskKind, named_task
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import STREAM, homes_of
from chmarl_pb.tasks.tidy_task import AnyTask, task_of

_DRAWS = 100  # tasks that are tried for a home before it counts as unplayable
_HOMES = 5  # of the endless split that are tried for an episode


class TaskSource:
    """Draws tasks of a split; for a home outside the split, and in the endless one, solvable tasks made up for a home.

    Attributes:
        episodes_in_a_home: so many seeds in a row, from a multiple of this on, begin in one home; as many episodes are
            played in it before the next. 1 where every episode may be in another.
    """

    def __init__(self, split: str, home: str | Path | None, kind: TaskKind, known: Catalog = BENCHMARK):
        """Remember where to draw from.

        Args:
            split: name of a split.
            home: name or path of the only home to play in, or None for all of the split.
            kind: of the tasks.
            known: the classes of things; with others than the benchmark's, tasks for training are drawn, too.
        """
        self._kind, self._split = kind, split
        self._homes = homes_of(split) if home is None else (str(home),)
        self._stream = HomeStream() if split == STREAM and home is None else None
        self.episodes_in_a_home = EPISODES_IN_A_HOME if self._stream else 1
        fixed = () if split == "train" and known != BENCHMARK else kind.tasks(split)
        self._tasks = [task for task in fixed if home is None or task.home == self._homes[0]]

    def named(self, task: AnyTask | Mapping[str, Any] | str) -> AnyTask:
        """Return a task given by itself, by its fields or by its id.

        Raises:
            TaskError: there is no such task.
        """
        if isinstance(task, AnyTask):
            return task
        if isinstance(task, Mapping):
            return _of_fields(task)
        if not isinstance(task, str):
            raise TaskError(f"options={{'task': ...}} got {type(task).__name__}; give a Task, its fields or its id")
        return named_task(self._kind, self._split, task)

    def begin(self, seed: int) -> None:
        """Begin anew with a seed: it decides in which home of the endless split the next task is."""
        if self._stream:
            self._stream.begin(seed)

    def draw(self, rng: np.random.Generator, simulation_of: Callable[[str], Simulation]) -> AnyTask:
        """Draw a task.

        Args:
            rng: source of randomness.
            simulation_of: the simulation of a home, by its name or path.

        Raises:
            TaskError: the home, or of the endless split several in a row, offers no task that can be solved.
        """
        if self._stream:
            return self._draw_in(self._stream, rng, simulation_of)
        if self._tasks:
            return self._tasks[rng.integers(len(self._tasks))]
        home = self._homes[rng.integers(len(self._homes))] if len(self._homes) > 1 else self._homes[0]
        return draw_solvable(simulation_of(home), home, rng, kind=self._kind)

    def _draw_in(
        self, stream: HomeStream, rng: np.random.Generator, simulation_of: Callable[[str], Simulation]
    ) -> AnyTask:
        """Draw a task for the next home; one that cannot be used is skipped."""
        home = stream.next(rng)
        for _ in range(_HOMES - 1):
            try:
                return draw_solvable(simulation_of(home), home, rng, kind=self._kind)
            except (HomeError, TaskError):
                home = stream.skip()
        return draw_solvable(simulation_of(home), home, rng, kind=self._kind)


def _of_fields(row: Mapping[str, Any]) -> AnyTask:
    """Return the task that ``dataclasses.asdict`` has made a row of, which may have been stored meanwhile."""
    try:
        return task_of({name: value.item() if isinstance(value, np.generic) else value for name, value in row.items()})
    except TypeError as error:
        raise TaskError(f"options={{'task': ...}} has not the fields of a Task ({error}); give all of them") from error


def draw_solvable(
    simulation: Simulation,
    home: str,
    rng: np.random.Generator,
    task_id: str | None = None,
    kind: TaskKind = REARRANGE,
    seeds_from: int = 0,
) -> AnyTask:
    """Draw a task for a home until the planner solves one, and return it with its L*.

    Args:
        simulation: of the home.
        home: the home's name or path, as the task is to name it.
        rng: source of randomness.
        task_id: the task's id; made of the home's name and the task's seed if None.
        kind: of the task.
        seeds_from: is added to its seed; from 2**31 on it is none that is drawn otherwise.

    Raises:
        TaskError: no drawn task can be solved.
    """
    reason = ""
    for _ in range(_DRAWS):
        task = kind.sample(simulation.space, home, rng, task_id)
        task = replace(task, seed=task.seed + seeds_from)
        try:
            return replace(task, optimal_steps=simulation.solve(task, kind).steps)
        except TaskError as error:
            reason = str(error)
    raise TaskError(f"{simulation.home.path}: none of {_DRAWS} drawn tasks can be solved; the last: {reason}")
