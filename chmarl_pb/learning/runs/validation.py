"""Greedy episodes during training; the best checkpoint is chosen by their score. Test splits are not for this."""

from collections import defaultdict
from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from torch import nn

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import core_of_parallel
from chmarl_pb.envs.words import action_number
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.metrics import path_weighted
from chmarl_pb.evaluation.optimum import optimum
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.recognition import Recognition, recognition, total
from chmarl_pb.learning.rollouts.collect import Collector, greedy
from chmarl_pb.learning.rollouts.replay_buffer import Episode
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.splits import TEST_SPLITS, VALIDATION, load_tasks
from chmarl_pb.tasks.task import Task

#: Returns figures of agents, among them "score", which is the greater the better.
Validate = Callable[[Collector, nn.ModuleDict], dict[str, float]]

SEEDS_FROM = 2**31  # training draws its seeds below


def by_return(episodes: int = 32) -> Validate:
    """Return a validation by the mean return of some episodes, always of the same seeds.

    Where homes are generated as they are needed, each is in a home of its own.
    """

    def validate(collector: Collector, agents: nn.ModuleDict) -> dict[str, float]:
        seeds = [SEEDS_FROM + number * collector.episodes_in_a_home for number in range(episodes)]
        played = play_greedily(collector, agents, seeds)
        return {"score": float(np.mean([episode.episode_return for episode in played]))}

    return validate


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
    return _by({split: spread_tasks(split, most) for split in splits})


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
    return _by({"home": home_tasks(home, most, robots, catalog, lookalikes)})


def home_tasks(
    home: str, most: int, robots: tuple[str, ...], catalog: str | None, lookalikes: bool = False
) -> list[Task]:
    """Return tasks that are drawn for a home, with seeds that training never draws; see :func:`by_home`."""
    return list(draw_tasks(home, most, 0, catalog, robots, SEEDS_FROM, lookalikes))


def _by(tasks: Mapping[str, Sequence[Task]]) -> Validate:
    """Return a validation by PLW on tasks by their split; the score is the mean over the splits."""
    known: dict[str, int] = {}  # task's id -> L*

    def validate(collector: Collector, agents: nn.ModuleDict) -> dict[str, float]:
        figures: dict[str, float] = {}
        noted: list[Recognition] = []
        for split, chosen in tasks.items():
            played = play_tasks(collector, agents, chosen, known)
            noted += [one.recognition for one in played]
            figures[f"{split}_sr"] = float(np.mean([one.success for one in played]))
            figures[f"{split}_plw"] = float(np.mean([one.score for one in played]))
        return (
            {"score": float(np.mean([figures[f"{split}_plw"] for split in tasks]))} | figures | total(noted).figures()
        )

    return validate


class PlayedTask(NamedTuple):
    """How a task was played: whether it was solved, its share of PLW, and how often robots act on what they see."""

    success: bool
    score: float
    recognition: Recognition


class Outcomes:
    """Notes the outcomes of episodes that are played side by side.

    Attributes:
        noted: number of an episode -> its outcomes, with that of the reset.
    """

    def __init__(self) -> None:
        """Begin with none."""
        self.noted: dict[int, list[Outcome]] = defaultdict(list)

    def note(self, number: int, env: Any) -> None:
        """Note what an episode has come to."""
        self.noted[number].append(core_of_parallel(env).outcome)


def play_tasks(
    collector: Collector, agents: nn.ModuleDict, tasks: Sequence[Task], known: dict[str, int] | None = None
) -> list[PlayedTask]:
    """Play each of some tasks once, without exploration.

    Args:
        collector: of environments of the benchmark.
        agents: agent -> its network.
        tasks: which.
        known: task's id -> L*, of tasks that were solved before; others are added.
    """
    known, width = {} if known is None else known, len(collector.envs)
    found: list[PlayedTask] = []
    for first in range(0, len(tasks), width):
        found += _play_side_by_side(collector, agents, tasks[first : first + width], known)
    return found


def _play_side_by_side(
    collector: Collector, agents: nn.ModuleDict, tasks: Sequence[Task], known: dict[str, int]
) -> list[PlayedTask]:
    outcomes, rng = Outcomes(), np.random.default_rng(0)  # draws nothing
    seeds, options = [episode_seed(task, 0) for task in tasks], [{"task": task} for task in tasks]
    episodes = collector.play(agents, greedy, rng, seeds, options, on_step=outcomes.note)
    cores = [core_of_parallel(env) for env in collector.envs[: len(tasks)]]
    return [
        _judged(core, episode, outcomes.noted[number], known)
        for number, (core, episode) in enumerate(zip(cores, episodes, strict=True))
    ]


def _judged(core: HouseholdEnv, episode: Episode, outcomes: list[Outcome], known: dict[str, int]) -> PlayedTask:
    """Return how a task was played, in an environment where its episode has just ended."""
    success, score = bool(episode.info[core.possible_agents[0]]["success"]), 0.0
    recognized = recognition(core, outcomes, _without_words(core, episode)) or Recognition()
    if success:
        task = core.task.id
        known[task] = known.get(task) or optimum(core).steps
        score = path_weighted(True, len(episode), known[task])
    return PlayedTask(success, score, recognized)


def _without_words(core: HouseholdEnv, episode: Episode) -> list[dict[str, int]]:
    """Return robot -> number of its action, in every step of an episode."""
    return [{name: action_number(name, row[name], core.symbols) for name in row} for row in episode.actions]


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
