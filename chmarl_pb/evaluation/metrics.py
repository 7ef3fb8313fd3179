"""The metrics: success rate and PLW as CH-MARL defines them, and what says how sure they are."""

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from chmarl_pb.envs.optimum import says_optimum
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import Episode
from chmarl_pb.errors import TaskError
from chmarl_pb.evaluation.intervals import rate_interval
from chmarl_pb.evaluation.optimum import optimum
from chmarl_pb.evaluation.recognition import Recognition, recognition
from chmarl_pb.tasks import language
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.task import Optimum
from chmarl_pb.tasks.tidy_task import AnyTask


@dataclass(frozen=True)
class Played:
    """One played episode, as far as results keep it.

    Attributes:
        task: the task.
        seed: seed of the evaluation.
        steps: L, joint steps taken.
        success: whether X stood on Y at the end.
        potential: phi at the end.
        actions: the numbers of the robots' actions in every step.
        optimum: of a success with other robots than the benchmark's, their L*, or that of a task without; else the
            task has it.
        instruction: what was asked for; empty in older results, where the task tells it.
        recognition: how often robots act on what they see; None in older results, and for tasks of several objects.
    """

    task: AnyTask
    seed: int
    steps: int
    success: bool
    potential: float
    actions: tuple[tuple[int, ...], ...] = ()
    optimum: Optimum | None = None
    instruction: str = ""
    recognition: Recognition | None = None

    @property
    def job(self) -> tuple[AnyTask, int]:
        """What was played: the task and the seed."""
        return self.task, self.seed

    @property
    def score(self) -> float:
        """The episode's share of PLW."""
        return path_weighted(self.success, self.steps, self.optimal_steps)

    @property
    def optimal_steps(self) -> int:
        """L* of the robots; of other robots than the benchmark's only where they have solved the task."""
        return self.optimum.steps if self.optimum else self.task.optimal_steps

    @property
    def wording(self) -> str:
        """Whether training shows all the words of the instruction: "seen" or "held-out"."""
        if self.instruction:
            return language.wording_of(self.instruction)
        return language.wording_of_task(self.task)


@dataclass(frozen=True)
class Figure:
    """A metric over seeds.

    Attributes:
        mean: over seeds; None if nothing counts, as for the length on success without a success.
        deviation: sample standard deviation over seeds; None with fewer than two.
        low: lower end of the bootstrap interval; None where there is none.
        high: upper end.
    """

    mean: float | None
    deviation: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True)
class Summary:
    """The metrics of some episodes.

    Attributes:
        episodes: how many there are.
        success_rate: share of episodes with success.
        plw: path-length-weighted score, the mean over all episodes of s L* / max(L, L*).
        length_on_success: joint steps, mean over the successes.
        final_potential: phi at the end.
    """

    episodes: int
    success_rate: Figure
    plw: Figure
    length_on_success: Figure
    final_potential: Figure


def path_weighted(success: bool, steps: int, optimal_steps: int) -> float:
    """Return s L* / max(L, L*): 1 for an optimal success, 0 for a failure.

    Args:
        success: s.
        steps: L, joint steps taken.
        optimal_steps: L*, the planner's number of steps, 1 or more; of a failure it does not matter.

    Raises:
        TaskError: L* is unknown.
    """
    if not success:
        return 0.0
    if optimal_steps < 1:
        raise TaskError(f"L* = {optimal_steps} is unknown; give the task its optimal_steps, as task files do")
    return optimal_steps / max(steps, optimal_steps)


def score_now(env: HouseholdEnv, success: bool, steps: int) -> float:
    """Return the share of PLW of an episode that an environment has just played in so many steps."""
    return path_weighted(True, steps, optimum(env).steps) if success else 0.0


def played(env: HouseholdEnv, episode: Episode, seed: int, outcomes: Sequence[Outcome] = ()) -> Played:
    """Return what results keep of an episode that an environment has just played.

    Args:
        env: the environment.
        episode: what it played.
        seed: of the evaluation.
        outcomes: before each action, if they were noted.

    Raises:
        TaskError: other robots than the benchmark's have solved a task that the planner cannot solve with them.
    """
    actions = tuple(tuple(chosen.values()) for chosen in episode.actions)
    shortest = optimum(env) if episode.success and not says_optimum(env, env.task) else None
    return Played(
        episode.task, seed, episode.steps, episode.success, float(episode.potential), actions, shortest,
        env.instruction, recognition(env, outcomes, episode.actions) if outcomes else None,
    )  # fmt: skip


def summarize(episodes: Sequence[Played], intervals: bool = True) -> Summary:
    """Return the metrics of episodes.

    Args:
        episodes: of all seeds.
        intervals: whether to add bootstrap intervals to the success rate and PLW.
    """
    success, score = _figure(episodes, _success), _figure(episodes, _score)
    if intervals:
        success, score = _with_interval(success, episodes, _success), _with_interval(score, episodes, _score)
    successes = [episode for episode in episodes if episode.success]
    return Summary(
        len(episodes), success, score, _figure(successes, lambda episode: episode.steps),
        _figure(episodes, lambda episode: episode.potential),
    )  # fmt: skip


def summarize_by(episodes: Sequence[Played], key: Callable[[AnyTask], str]) -> dict[str, Summary]:
    """Return the metrics of groups of episodes, without intervals.

    Args:
        episodes: of all seeds.
        key: the group of a task.
    """
    groups: dict[str, list[Played]] = defaultdict(list)
    for episode in episodes:
        groups[key(episode.task)].append(episode)
    return {name: summarize(groups[name], intervals=False) for name in sorted(groups)}


def summarize_by_wording(episodes: Sequence[Played]) -> dict[str, Summary]:
    """Return the metrics of episodes with seen and with held-out wording, of those that there are, in this order."""
    groups = {name: [episode for episode in episodes if episode.wording == name] for name in language.WORDINGS}
    return {name: summarize(same) for name, same in groups.items() if same}


def of_tasks(episodes: Sequence[Played], value: Callable[[Played], float]) -> dict[AnyTask, float]:
    """Return the mean over seeds of a value of each task, in the order of their ids."""
    tasks: dict[AnyTask, list[float]] = defaultdict(list)
    for episode in episodes:
        tasks[episode.task].append(value(episode))
    return {task: float(np.mean(tasks[task])) for task in sorted(tasks, key=lambda task: task.id)}


def by_home(values: Mapping[AnyTask, float]) -> dict[str, list[float]]:
    """Return the values of tasks by their homes, as intervals are made of them."""
    homes: dict[str, list[float]] = defaultdict(list)
    for task, value in values.items():
        homes[task.home].append(value)
    return homes


def _figure(episodes: Iterable[Played], value: Callable[[Played], float]) -> Figure:
    """Return mean and standard deviation of the seeds' means."""
    seeds: dict[int, list[float]] = defaultdict(list)
    for episode in episodes:
        seeds[episode.seed].append(value(episode))
    means = [float(np.mean(seeds[seed])) for seed in sorted(seeds)]
    if not means:
        return Figure(None)
    return Figure(float(np.mean(means)), float(np.std(means, ddof=1)) if len(means) > 1 else None)


def _with_interval(figure: Figure, episodes: Sequence[Played], value: Callable[[Played], float]) -> Figure:
    if len({episode.task for episode in episodes}) < 2:
        return figure
    return Figure(figure.mean, figure.deviation, *rate_interval(by_home(of_tasks(episodes, value))))


def _success(episode: Played) -> float:
    return float(episode.success)


def _score(episode: Played) -> float:
    return episode.score
