"""Which task an episode plays: one that is named, one of a split, or one made up for a home."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import TaskError
from chmarl_pb.tasks.kinds import REARRANGE, TaskKind
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import SPLIT_HOMES, find_task
from chmarl_pb.tasks.tidy_task import AnyTask

_DRAWS = 100  # tasks that are tried for a home before it counts as unplayable


class TaskSource:
    """Draws tasks of a split; for a home outside the split, solvable tasks made up for that home."""

    def __init__(self, split: str, home: str | Path | None, kind: TaskKind, known: Catalog = BENCHMARK):
        """Remember where to draw from.

        Args:
            split: name of a split.
            home: name or path of the only home to play in, or None for all of the split.
            kind: of the tasks.
            known: the classes of things; with others than the benchmark's, tasks for training are drawn, too.
        """
        self._kind, self._homes = kind, SPLIT_HOMES[split] if home is None else (str(home),)
        fixed = () if split == "train" and known != BENCHMARK else kind.tasks(split)
        self._tasks = [task for task in fixed if home is None or task.home == str(home)]

    def named(self, task: AnyTask | str) -> AnyTask:
        """Return a task given by itself or by its id.

        Raises:
            TaskError: there is no such task.
        """
        if isinstance(task, AnyTask):
            return task
        if not isinstance(task, str):
            raise TaskError(f"options={{'task': ...}} got {type(task).__name__}; give a Task or a task's id")
        return find_task(task)

    def draw(self, rng: np.random.Generator, simulation_of: Callable[[str], Simulation]) -> AnyTask:
        """Draw a task.

        Args:
            rng: source of randomness.
            simulation_of: the simulation of a home, by its name or path.

        Raises:
            TaskError: the home offers no task that can be solved.
        """
        if self._tasks:
            return self._tasks[rng.integers(len(self._tasks))]
        home = self._homes[rng.integers(len(self._homes))] if len(self._homes) > 1 else self._homes[0]
        return draw_solvable(simulation_of(home), home, rng, kind=self._kind)


def draw_solvable(
    simulation: Simulation,
    home: str,
    rng: np.random.Generator,
    task_id: str | None = None,
    kind: TaskKind = REARRANGE,
) -> AnyTask:
    """Draw a task for a home until the planner solves one, and return it with its L*.

    Args:
        simulation: of the home.
        home: the home's name or path, as the task is to name it.
        rng: source of randomness.
        task_id: the task's id; made of the home's name and the task's seed if None.
        kind: of the task.

    Raises:
        TaskError: no drawn task can be solved.
    """
    reason = ""
    for _ in range(_DRAWS):
        task = kind.sample(simulation.space, home, rng, task_id)
        try:
            return replace(task, optimal_steps=simulation.solve(task, kind).steps)
        except TaskError as error:
            reason = str(error)
    raise TaskError(f"{simulation.home.path}: none of {_DRAWS} drawn tasks can be solved; the last: {reason}")
