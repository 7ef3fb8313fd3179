"""Greedy episodes during training; the best checkpoint is chosen by their score. Test splits are not for this."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from torch import nn

from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.metrics import path_weighted
from chmarl_pb.evaluation.optimum import optimum
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.recognition import Recognition, recognition, total
from chmarl_pb.fingerprint import fingerprint
from chmarl_pb.learning.policies.side_by_side import End, play_tasks
from chmarl_pb.learning.rollouts.collect import Collector, Explorer, greedy
from chmarl_pb.learning.rollouts.replay_buffer import Episode
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.splits import TEST_SPLITS, VALIDATION, load_tasks
from chmarl_pb.tasks.task import Task

#: Returns figures of agents, among them "score", which is the greater the better.
Validate = Callable[[Collector, nn.ModuleDict], dict[str, float]]

SEEDS_FROM = 2**31  # training draws its seeds below


def scores_of(validate: Validate) -> dict[str, str]:
    """Return what tells the scores by which weights are chosen: the name of the function, and a hash of what it holds.

    Functions of one name differ by their arguments, as validations on other splits; the hash is "" where none is known.
    """
    function: Any = validate.func if isinstance(validate, partial) else validate
    name = str(getattr(function, "__qualname__", type(function).__qualname__))
    return {"name": name, "sha256": fingerprint(validate, code=False) or ""}


def by_return(episodes: int = 32) -> Validate:
    """Return a validation by the mean return of some episodes, always of the same seeds.

    Where homes are generated as they are needed, each is in a home of its own.
    """
    return partial(mean_return, episodes=episodes)


def mean_return(collector: Collector, agents: nn.ModuleDict, episodes: int) -> dict[str, float]:
    """Return the mean return of some episodes as the score; see :func:`by_return`."""
    seeds = [SEEDS_FROM + number * collector.episodes_in_a_home for number in range(episodes)]
    played = play_greedily(collector, agents, seeds)
    return {"score": float(np.mean([episode.episode_return for episode in played]))}


def by_tasks(splits: Sequence[str] = VALIDATION["train"], most: int = 50) -> Validate:
    """Return a validation by PLW on the benchmark's validation tasks; the score is the mean over the splits.

    Args:
        splits: which; no test split.
        most: tasks of a split; if it has more, they are taken at equal distances.

    Raises:
        ValueError: a split is for tests.
    """
    if not set(splits).isdisjoint(TEST_SPLITS):
        raise ValueError(f"splits={list(splits)}: checkpoints are not chosen on a test split")
    return _ByTasks({split: spread_tasks(split, most) for split in splits})


def by_home(
    home: str,
    most: int = 50,
    robots: tuple[str, ...] = TEAM,
    catalog: str | None = None,
    lookalikes: bool = False,
) -> Validate:
    """Return a validation by PLW on tasks that are drawn for a home, none of which is one of training.

    Args:
        home: name or path.
        most: how many tasks.
        robots: names and robot files.
        catalog: catalogue file of own things.
        lookalikes: whether they are to be solved among lookalikes.

    Raises:
        HomeError: the home cannot be used.
        TaskError: the home offers no task that can be solved.
    """
    return _ByTasks({"home": home_tasks(home, most, robots, catalog, lookalikes)})


def home_tasks(
    home: str, most: int, robots: tuple[str, ...], catalog: str | None, lookalikes: bool = False
) -> list[Task]:
    """Return tasks that are drawn for a home, with seeds that training never draws; see :func:`by_home`."""
    drawn = draw_tasks(home, most, seeds_from=SEEDS_FROM, robots=robots, catalog=catalog, lookalikes=lookalikes)
    return list(drawn)


class _ByTasks:
    """A validation by PLW on tasks by their split; the score is the mean over the splits."""

    def __init__(self, tasks: Mapping[str, Sequence[Task]]):
        self._tasks = tasks
        self._known: dict[str, int] = {}  # task's id -> L*

    def __reduce__(self) -> tuple[Any, ...]:
        """What it holds are its tasks; what it finds out of them makes it no other."""
        return type(self), (self._tasks,)

    def __call__(self, collector: Collector, agents: nn.ModuleDict) -> dict[str, float]:
        figures: dict[str, float] = {}
        noted: list[Recognition] = []
        for split, chosen in self._tasks.items():
            played = examine(collector, agents, chosen, self._known)
            noted += [one.recognition for one in played]
            figures[f"{split}_sr"] = float(np.mean([one.success for one in played]))
            figures[f"{split}_plw"] = float(np.mean([one.score for one in played]))
        score = float(np.mean([figures[f"{split}_plw"] for split in self._tasks]))
        return {"score": score} | figures | total(noted).figures()


class PlayedTask(NamedTuple):
    """How a task was played: whether it was solved, its share of PLW, and how often robots act on what they see."""

    success: bool
    score: float
    recognition: Recognition


def examine(
    collector: Collector, agents: nn.ModuleDict, tasks: Sequence[Task], known: dict[str, int] | None = None
) -> list[PlayedTask]:
    """Play each of some tasks once, without exploration.

    Args:
        collector: of environments of the benchmark.
        agents: agent -> its network.
        tasks: which.
        known: task's id -> L*, of tasks that were solved before; others are added.
    """
    known, envs = {} if known is None else known, collector.envs
    policy = Explorer(agents, greedy, np.random.default_rng(0), check=collector.check)  # draws nothing
    found: list[PlayedTask] = []
    for first in range(0, len(tasks), len(envs)):
        some = tasks[first : first + len(envs)]
        ends = play_tasks(policy, envs, some, [episode_seed(task, 0) for task in some])
        judged = {end.number: _judged(end, known) for end in ends}
        found += [judged[number] for number in range(len(some))]
    return found


def _judged(end: End, known: dict[str, int]) -> PlayedTask:
    """Return how a task was played, in an environment where its episode has just ended."""
    core, score = end.core, 0.0
    if success := core.outcome.success:
        task = core.task.id
        known[task] = known.get(task) or optimum(core).steps
        score = path_weighted(True, core.steps, known[task])
    return PlayedTask(success, score, recognition(core, end.outcomes, end.actions) or Recognition())


def play_greedily(collector: Collector, agents: nn.ModuleDict, seeds: Sequence[int]) -> list[Episode]:
    """Play one episode for each seed without exploration, in rollouts."""
    rng, width = np.random.default_rng(0), len(collector.envs)  # draws nothing
    played: list[Episode] = []
    for first in range(0, len(seeds), width):
        played += collector.play(agents, greedy, rng, seeds[first : first + width])
    return played


def spread_tasks(split: str, most: int) -> list[Task]:
    """Return at most some of a split's tasks, at equal distances, so that every home has its share."""
    tasks = load_tasks(split)
    places = np.linspace(0, len(tasks), min(most, len(tasks)), endpoint=False).astype(int)
    return [tasks[place] for place in places]
