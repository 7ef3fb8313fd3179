"""Make data sets: the planner plays every task of a split once, in several processes."""

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import gymnasium

from chmarl_pb.data.read import Dataset
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.record import NoisyPlanner, make_env, record
from chmarl_pb.data.store import dataset_folder, is_whole, join_parts, part_of, parts_folder, write_part
from chmarl_pb.errors import DatasetError
from chmarl_pb.executors import Executor, executor_of
from chmarl_pb.files import Lock
from chmarl_pb.policies.policy import core_of
from chmarl_pb.tasks.task import Task

Progress = Callable[[int], Any]


def generate(
    recipe: Recipe,
    root: Path,
    workers: int = 2,
    progress: Progress = lambda _: None,
    executor: Executor | None = None,
) -> Dataset:
    """Make a data set, or finish one that was interrupted; one that is complete is left as it is.

    Args:
        recipe: what to make.
        root: folder of Minari data sets.
        workers: number of processes.
        progress: called with the number of episodes that are done since its last call.
        executor: where the work is done, e.g. a :class:`chmarl_pb.ray_executor.RayExecutor`; None: in ``workers``
            processes of this machine.

    Raises:
        DatasetError: another data set of this name is in the folder.
        BusyError: another process is making it.
        WorkerError: a process died; finished episodes are kept.
        WriteError: the disk is full; finished episodes are kept.
    """
    executor = executor_of(executor, workers)
    folder = dataset_folder(root, recipe.dataset_id)
    if not folder.exists():
        with Lock(folder):
            if not folder.exists():  # another process may just have made it
                return _make(recipe, root, executor, progress)
    dataset = Dataset(folder)
    if other := recipe.differing(dataset.recipe):
        raise DatasetError(f"{folder}: made from another {' and '.join(other)}; remove it or choose another --out")
    progress(dataset.episodes)
    return dataset


def _make(recipe: Recipe, root: Path, executor: Executor, progress: Progress) -> Dataset:
    tasks = recipe.tasks
    parts = _parts(recipe, root, tasks)
    missing = [number for number, part in enumerate(parts) if not is_whole(part)]
    progress(len(parts) - len(missing))
    jobs = [tasks[number] for number in missing]
    for task_id, part in executor.map(partial(_play, recipe), jobs):
        write_part(parts[0].with_name(f"{task_id}.hdf5"), part)
        progress(1)
    return Dataset(join_parts(root, recipe, parts))


def _parts(recipe: Recipe, root: Path, tasks: Sequence[Task]) -> list[Path]:
    """Return the files of all episodes, in order; files left of another recipe or version are not used."""
    folder = parts_folder(root, recipe)
    folder.mkdir(parents=True, exist_ok=True)
    return [folder / f"{task.id}.hdf5" for task in tasks]


def _play(recipe: Recipe, task: Task) -> tuple[str, bytes]:
    """Play one task and return its id and its episode as a file; the environment is kept for the next one."""
    env = environment(recipe)
    driver = NoisyPlanner(core_of(env), recipe.noise, recipe.seed)
    return task.id, part_of(record(env, driver, task))


@lru_cache(maxsize=1)
def environment(recipe: Recipe) -> gymnasium.Env:
    """Return this process's environment for a recipe; it lives as long as the process."""
    return make_env(recipe)
