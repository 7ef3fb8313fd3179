"""Verify data sets: check their files, replay the stored actions, and compare all that is stored."""

from collections.abc import Iterator
from dataclasses import fields
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb.data.generate import Progress, environment
from chmarl_pb.data.read import Dataset
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.record import Arrays, replay
from chmarl_pb.errors import DatasetError, OptionError
from chmarl_pb.evaluation.json_file import WRONG
from chmarl_pb.executors import Executor, executor_of
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.task import Task

_LONGEST = 100  # characters of a wrong value in a message


def chosen(episodes: int, share: float) -> list[int]:
    """Return the numbers of a share of episodes, evenly spread, at least one.

    Raises:
        OptionError: the share is not above 0 and at most 1.
    """
    if not 0 < share <= 1:
        raise OptionError(f"share {share}: use a number above 0 and up to 1")
    count = max(1, round(share * episodes))
    return [int(number) for number in np.unique(np.linspace(0, episodes - 1, count).astype(int))]


def verify(
    dataset: Dataset,
    share: float = 1.0,
    workers: int = 2,
    progress: Progress = lambda _: None,
    executor: Executor | None = None,
) -> int:
    """Check a data set's file and replay a share of its episodes.

    Args:
        dataset: what to verify.
        share: of its episodes, above 0 and up to 1.
        workers: number of processes.
        progress: called with 1 for each replayed episode.
        executor: where the work is done, e.g. a :class:`chmarl_pb.ray_executor.RayExecutor`; None: in ``workers``
            processes of this machine.

    Returns:
        Number of replayed episodes.

    Raises:
        DatasetError: the file is damaged, the data set was made from other homes or tasks, or a replay differs.
    """
    recipe = _recipe(dataset)
    dataset.check()
    numbers = chosen(dataset.episodes, share)
    tasks = recipe.tasks
    jobs = ((number, tasks[number], *dataset.episode(number)) for number in numbers)
    for _ in executor_of(executor, workers).map(partial(_replay, dataset.main, recipe), jobs):
        progress(1)
    return len(numbers)


def _recipe(dataset: Dataset) -> Recipe:
    """Return the recipe that made a data set.

    Raises:
        DatasetError: homes, tasks or format are not those that it was made with.
    """
    try:
        options = {one.name: dataset.recipe[one.name] for one in fields(Recipe) if one.name in dataset.recipe}
        recipe = Recipe(**options | {"robots": tuple(options.get("robots", TEAM))})
    except WRONG as error:
        raise DatasetError(
            f"{dataset.folder}: its recipe is damaged: {repr(error)[:200]}; generate it again"
        ) from error
    if other := recipe.differing(dataset.recipe):
        version = dataset.metadata.get("made_with", {}).get("chmarl-pb", "unknown")
        raise DatasetError(
            f"{dataset.folder}: made by version {version} from another {' and '.join(other)}; "
            "verify it with what it was made with, or generate it again"
        )
    return recipe


def _replay(file: Path, recipe: Recipe, job: tuple[int, Task, Arrays, dict[str, Any]]) -> None:
    """Replay a stored episode; the file is only named in errors."""
    number, task, stored, metadata = job
    place = f"{file}: episode {number}"
    actions = stored["actions"]
    assert isinstance(actions, np.ndarray)
    replayed = replay(environment(recipe), actions, task)
    difference = first_difference(stored, replayed.arrays)
    if difference:
        raise DatasetError(f"{place} ({task.id}): the replay differs in {difference}")
    for name, value in replayed.metadata.items():
        if metadata.get(name) != value:
            raise DatasetError(f"{place} has {name} {str(metadata.get(name))[:_LONGEST]!r} instead of {value!r}")


def first_difference(stored: Arrays, replayed: Arrays) -> str | None:
    """Return the name of the first array that differs and the first step at which it does; None if all are equal."""
    mine, other = dict(_flat(stored)), dict(_flat(replayed))
    if mine.keys() != other.keys():
        return "the names of its arrays: " + ", ".join(sorted(mine.keys() ^ other.keys()))
    for name in sorted(mine, key=lambda name: name != "infos/state_hash"):  # the most telling first
        if np.array_equal(mine[name], other[name]):
            continue
        if mine[name].shape != other[name].shape:
            return f"{name}: shape {mine[name].shape} instead of {other[name].shape}"
        unlike = (mine[name] != other[name]).reshape(len(mine[name]), -1).any(axis=1)
        return f"{name} at step {int(np.argmax(unlike))}"
    return None


def _flat(arrays: Arrays, prefix: str = "") -> Iterator[tuple[str, np.ndarray]]:
    for name, values in arrays.items():
        if isinstance(values, dict):
            yield from _flat(values, f"{prefix}{name}/")
        else:
            yield f"{prefix}{name}", values
