"""Statistics: of the benchmark's tasks, of data sets on disk, and of the language that they hold."""

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from functools import cache
from typing import Any

from chmarl_pb.data.read import Dataset, read_group
from chmarl_pb.homes.home import load_home
from chmarl_pb.tasks.language import corpus_statistics, instruction
from chmarl_pb.tasks.splits import BENCHMARK_SPLITS, load_tasks
from chmarl_pb.tasks.task import Task

Facts = dict[str, Any]


def task_statistics(tasks: Iterable[Task]) -> Facts:
    """Return numbers of tasks by class, home, room and L*; everything as plain data for JSON."""
    tasks = list(tasks)
    steps = [task.optimal_steps for task in tasks]
    return {
        "tasks": len(tasks),
        "mean_optimal_steps": sum(steps) / len(steps) if steps else 0.0,
        "optimal_steps": _counts(steps),
        "homes": _counts(task.home for task in tasks),
        "graspables": _counts(task.graspable for task in tasks),
        "sources": _counts(task.source for task in tasks),
        "targets": _counts(task.target for task in tasks),
        "rooms_with_a_source": _counts(room for task in tasks for room in _rooms(task.home, task.source)),
        "rooms_with_a_target": _counts(room for task in tasks for room in _rooms(task.home, task.target)),
    }


@cache
def _rooms(home: str, class_name: str) -> tuple[str, ...]:
    """Return the rooms of a home in which receptacles of a class stand."""
    things = load_home(home).receptacles.values()
    return tuple(sorted({thing.room for thing in things if thing.class_name == class_name}))


def dataset_statistics(dataset: Dataset) -> Facts:
    """Return numbers of episodes, steps, successes, actions and lengths of a data set, and its size in bytes.

    Raises:
        DatasetError: the file is damaged.
    """
    lengths: list[int] = []
    successes = relabelled = sentences = 0
    for arrays, metadata in _episodes(dataset):
        lengths.append(int(metadata["total_steps"]))
        successes += bool(metadata["success"])
        infos = arrays["infos"]
        relabelled += int((infos["planner_action"][:-1] != arrays["actions"]).any(axis=1).sum())
        sentences += sum(int((infos[robot]["feedback"] != b"").sum()) for robot in _robots(infos))
    return {
        "id": dataset.dataset_id,
        "episodes": dataset.episodes,
        "steps": dataset.steps,
        "success_rate": successes / max(len(lengths), 1),
        "steps_off_the_plan": relabelled,
        "feedback_sentences": sentences,
        "lengths": _counts(lengths),
        "bytes": dataset.size,
    }


def language_statistics(datasets: Iterable[Dataset]) -> Facts:
    """Return statistics of the corpus: the instructions of all tasks, and the feedback in data sets."""
    sentences = [instruction(task) for split in BENCHMARK_SPLITS for task in load_tasks(split)]
    for dataset in datasets:
        for arrays, _ in _episodes(dataset):
            for robot in _robots(arrays["infos"]):
                sentences += [text.decode() for text in arrays["infos"][robot]["feedback"] if text]
    return asdict(corpus_statistics(sentences))


def added(counts: Iterable[dict[str, int]]) -> dict[str, int]:
    """Return the sum of several counts of whole numbers, in the order of the numbers."""
    total: Counter[str] = Counter()
    for part in counts:
        total.update(part)
    return {value: total[value] for value in sorted(total, key=int)}


def _episodes(dataset: Dataset) -> Iterator[tuple[Facts, Facts]]:
    """Yield actions, infos and metadata of every episode; observations are not read."""
    with dataset.open() as file:
        for number in range(dataset.episodes):
            group = file[f"episode_{number}"]
            yield read_group(group, "actions", "infos"), dict(group.attrs)


def _robots(infos: Facts) -> list[str]:
    """Return the robots: what is known of each lies in a group of its own."""
    return [name for name, part in infos.items() if isinstance(part, dict)]


def _counts(values: Iterable[Any]) -> dict[str, int]:
    return {str(value): count for value, count in sorted(Counter(values).items())}
