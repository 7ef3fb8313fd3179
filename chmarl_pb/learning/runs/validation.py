"""Greedy episodes during training; the best checkpoint is chosen by their score. Test splits are not for this."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from torch import nn

from chmarl_pb.envs.rollout import core_of_parallel
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.metrics import path_weighted
from chmarl_pb.evaluation.optimum import optimal_steps
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.learning.runs.collect import Collector, greedy
from chmarl_pb.learning.runs.replay_buffer import Episode
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task

#: Returns figures of agents, among them "score", which is the greater the better.
Validate = Callable[[Collector, nn.ModuleDict], dict[str, float]]

SEEDS_FROM = 2**31  # training draws its seeds below


def by_return(episodes: int = 32) -> Validate:
    """Return a validation by the mean return of some episodes, always with the same seeds."""
    seeds = range(SEEDS_FROM, SEEDS_FROM + episodes)

    def validate(collector: Collector, agents: nn.ModuleDict) -> dict[str, float]:
        played = play_greedily(collector, agents, seeds)
        return {"score": float(np.mean([episode.episode_return for episode in played]))}

    return validate


def by_tasks(splits: Sequence[str] = ("val-seen", "val-unseen"), most: int = 50) -> Validate:
    """Return a validation by PLW on the benchmark's validation tasks; the score is the mean over the splits.

    Args:
        splits: which; no test split.
        most: tasks of a split; if it has more, they are taken at equal distances.

    Raises:
        ValueError: a split is for tests.
    """
    if any(split.startswith("test") for split in splits):
        raise ValueError(f"splits={list(splits)}: checkpoints are not chosen on a test split")
    return _by({split: spread_tasks(split, most) for split in splits})


def by_home(home: str, most: int = 50, robots: tuple[str, ...] = TEAM, catalog: str | None = None) -> Validate:
    """Return a validation by PLW on tasks that are drawn for a home, none of which is one of training.

    Args:
        home: name or path.
        most: how many tasks.
        robots: names and robot files.
        catalog: catalogue file of own things.

    Raises:
        HomeError: the home cannot be used.
        TaskError: the home offers no task that can be solved.
    """
    return _by({"home": home_tasks(home, most, robots, catalog)})


def home_tasks(home: str, most: int, robots: tuple[str, ...], catalog: str | None) -> list[Task]:
    """Return tasks that are drawn for a home, with seeds that training never draws; see :func:`by_home`."""
    return list(draw_tasks(home, most, 0, catalog, robots, SEEDS_FROM))


def _by(tasks: Mapping[str, Sequence[Task]]) -> Validate:
    """Return a validation by PLW on tasks by their split; the score is the mean over the splits."""
    known: dict[str, int] = {}  # task's id -> L*

    def validate(collector: Collector, agents: nn.ModuleDict) -> dict[str, float]:
        figures: dict[str, float] = {}
        core = core_of_parallel(collector.envs[0])
        for split, chosen in tasks.items():
            seeds, options = [episode_seed(task, 0) for task in chosen], [{"task": task} for task in chosen]
            played = play_greedily(collector, agents, seeds, options)
            won = [episode.info[core.possible_agents[0]]["success"] for episode in played]
            scores = [0.0] * len(won)
            for number in np.flatnonzero(won).tolist():
                task = chosen[number]
                best = known[task.id] = known.get(task.id) or optimal_steps(core, task)
                scores[number] = path_weighted(True, len(played[number]), best)
            figures |= {f"{split}_sr": float(np.mean(won)), f"{split}_plw": float(np.mean(scores))}
        return {"score": float(np.mean([figures[f"{split}_plw"] for split in tasks]))} | figures

    return validate


def play_greedily(
    collector: Collector,
    agents: nn.ModuleDict,
    seeds: Sequence[int],
    options: Sequence[dict[str, Any]] | None = None,
) -> list[Episode]:
    """Play one episode for each seed without exploration, in rollouts."""
    rng, width = np.random.default_rng(0), len(collector.envs)  # draws nothing
    played: list[Episode] = []
    for first in range(0, len(seeds), width):
        rollout = slice(first, first + width)
        played += collector.play(agents, greedy, rng, seeds[rollout], options[rollout] if options else None)
    return played


def spread_tasks(split: str, most: int) -> list[Task]:
    """Return at most some of a split's tasks, at equal distances, so that every home has its share."""
    tasks = load_tasks(split)
    places = np.linspace(0, len(tasks), min(most, len(tasks)), endpoint=False).astype(int)
    return [tasks[place] for place in places]
