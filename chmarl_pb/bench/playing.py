"""Figures that are measured inside this process: each is an endless stream of samples, unit -> value."""

import statistics
import time
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing
from dataclasses import dataclass
from functools import cache
from itertools import cycle

import numpy as np

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.rendering.home_views import home_views
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE
from chmarl_pb.robots.execution import TICKS_PER_FRAME
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import TIME_STEP

SPLIT = "test-unseen"
Sample = dict[str, float]
Samples = Generator[Sample, None, None]


@dataclass(frozen=True)
class Effort:
    """How much is spent on a figure.

    Attributes:
        runs: samples taken; the table shows their median, the least and the greatest.
        seconds: least duration of one sample.
        warm_up: joint steps of a random policy; the views that they come by are drawn before what is measured warm.
    """

    runs: int = 5
    seconds: float = 1.0
    warm_up: int = 100_000


def steps(
    effort: Effort, observation: str, size: int = VISIBILITY_SIZE, split: str = SPLIT, pointing: bool = False
) -> Samples:
    """Yield joint steps a second of a random policy, resets included, when the views of the home are warm.

    Played are a split's tasks in its first home, in a random order, over and over. A tenth of them is also played to
    warm up, or all of them if there are but 50: training has so many that most are new, tests have few.
    """
    few, others = tasks_to_play(split)
    with closing(HouseholdEnv(observation, split=split, image_size=size, pointing=pointing)) as env:
        env.reset(options={"task": few[0]})
        warm_up(env, scouted_poses(effort.warm_up, split))
        rng = np.random.default_rng(1)
        tasks = cycle(rng.permutation(np.array(others, dtype=object)).tolist())
        play(env, rng, 100, tasks)
        while True:
            rate = per_second(lambda: play(env, rng, 50, tasks), effort.seconds, 50)
            yield {"joint steps/s": rate} | (
                {"frames/s": len(env.possible_agents) * rate} if observation == "visual" else {}
            )


def tasks_to_play(split: str) -> tuple[list[Task], list[Task]]:
    """Return a split's tasks in its first home: those to warm up with, and those to measure with."""
    tasks = [task for task in load_tasks(split) if task.home == load_tasks(split)[0].home]
    return (tasks, tasks) if len(tasks) <= 50 else (tasks[::10], [task for n, task in enumerate(tasks) if n % 10])


def resets(effort: Effort) -> Samples:
    """Yield resets a second, when the views of the home are warm."""
    with closing(HouseholdEnv(split=SPLIT)) as env:
        for task in load_tasks(SPLIT):
            env.reset(options={"task": task})
        env.reset(seed=1)
        while True:
            yield {"resets/s": per_second(env.reset, effort.seconds)}


def planning(effort: Effort) -> Samples:
    """Yield the median time in milliseconds that the planner takes for a task, when the views are warm."""
    with closing(HouseholdEnv(split=SPLIT)) as env:
        tasks = load_tasks(SPLIT)[: max(1, round(50 * effort.seconds))]

        def plan(task: Task) -> float:
            env.reset(options={"task": task})
            start = time.perf_counter()
            env.simulation.oracle.plan(env.setting.goal)
            return 1000 * (time.perf_counter() - start)

        for task in tasks:
            plan(task)
        while True:
            yield {"ms": statistics.median(plan(task) for task in tasks)}


def driving(effort: Effort) -> Samples:
    """Yield how many times faster than the robots themselves their driven motions run, in episodes of the planner.

    Collisions are motions for which no free way was found.
    """
    with closing(HouseholdEnv(split=SPLIT, execution="simulated")) as env:
        policy, tasks = make_policy("planner", env), cycle(load_tasks(SPLIT))
        env.reset(seed=0)
        while True:
            start, moved, collided = time.perf_counter(), 0.0, 0
            while time.perf_counter() - start < effort.seconds or not moved:
                moved += _drive(env, policy, next(tasks))
                collided += env.collisions
            yield {"times real time": moved / (time.perf_counter() - start), "collisions": collided}


def _drive(env: HouseholdEnv, policy: Policy, task: Task) -> float:
    """Play an episode and return how long its motions last, in seconds of the robots' time."""
    observations, infos = env.reset(options={"task": task})
    policy.reset(None)
    snapshots = 0
    while env.agents:
        observations, _, _, _, infos = env.step(policy.act(observations, infos))
        snapshots += len(env.snapshots)
    return snapshots * TICKS_PER_FRAME * TIME_STEP


@cache
def scouted_poses(count: int, split: str = SPLIT) -> tuple[tuple[str, int], ...]:
    """Return the camera poses, as robot and number, that a random policy comes by in some joint steps."""
    poses: set[tuple[str, int]] = set()
    with closing(HouseholdEnv(split=split)) as env:
        rng, tasks = np.random.default_rng(0), cycle(tasks_to_play(split)[0])
        for _ in range(count):
            play(env, rng, 1, tasks)
            poses |= {(name, robot.pose) for name, robot in env.world.robots.items()}
    return tuple(sorted(poses))


def warm_up(env: HouseholdEnv, poses: Iterable[tuple[str, int]]) -> None:
    """Draw the empty home as it is seen from camera poses, in the sizes that an environment needs."""
    views = home_views(env.world.home)
    for size in {VISIBILITY_SIZE, env.options.image_size}:
        for robot, pose in poses:
            views.look(env.simulation.models[robot], pose, size)


def play(env: HouseholdEnv, rng: np.random.Generator, count: int, tasks: Iterator[Task]) -> None:
    """Take joint steps of a random policy, and begin the next task whenever an episode ends."""
    choices = [len(names) for names in env.action_names.values()]
    for numbers in rng.integers(choices, size=(count, len(choices))).tolist():
        if not env.agents:
            env.reset(options={"task": next(tasks)})
        env.step(dict(zip(env.possible_agents, numbers, strict=True)))


def per_second(work: Callable[[], object], seconds: float, count: int = 1) -> float:
    """Return how often something is done in a second, repeating work that does it ``count`` times."""
    start, done = time.perf_counter(), 0
    while True:
        work()
        done += count
        taken = time.perf_counter() - start
        if taken >= seconds:
            return done / taken
