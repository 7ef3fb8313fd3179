"""Every feedback sentence is true: what it says was done was done, and what it recommends works."""

from collections.abc import Iterator

import numpy as np
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.tasks import language
from chmarl_pb.tasks.task import Task
from tests.helpers.feedback_reader import read


@pytest.fixture(scope="module")
def planner_env() -> Iterator[HouseholdEnv]:
    env = HouseholdEnv(feedback="planner", max_steps=25)
    yield env
    env.close()


@pytest.fixture(scope="module")
def twin() -> Iterator[HouseholdEnv]:
    """An environment that is brought to the states in which something was said."""
    env = HouseholdEnv(feedback=False, max_steps=1000)
    yield env
    env.close()


def played(
    env: HouseholdEnv, task: Task, seed: int, detours: float, steps: int = 25
) -> Iterator[tuple[str, list[dict[str, int]], bool]]:
    """Play up to 25 steps of the planner with random detours; yield feedback, actions so far, success of the last.

    Args:
        env: where to play.
        task: what to play.
        seed: of the detours.
        detours: share of random steps; 1 is the random policy.
        steps: after which it ends.
    """
    rng = np.random.default_rng(seed)
    env.reset(options={"task": task})
    names = env.action_names["humanoid"]
    plan: list[str] = []
    taken: list[dict[str, int]] = []
    while env.agents and len(taken) < steps:
        astray = rng.random() < detours
        if not astray and not plan:
            plan = env.simulation.oracle.plan(env.setting.goal)
        action = int(rng.integers(len(names))) if astray else names.index(plan.pop(0))
        plan = [] if astray else plan
        taken.append({"humanoid": action, "drone": int(rng.integers(9))})
        infos = env.step(taken[-1])[-1]
        assert infos["drone"]["feedback"] == ""
        yield infos["humanoid"]["feedback"], taken, infos["humanoid"]["action_success"]


def rewound(twin: HouseholdEnv, task: Task, actions: list[dict[str, int]]) -> HouseholdEnv:
    """Return the twin in the state before the last of the actions."""
    twin.reset(options={"task": task})
    for action in actions[:-1]:
        twin.step(action)
    return twin


def check_paper(twin: HouseholdEnv, task: Task, text: str, actions: list[dict[str, int]], succeeded: bool) -> None:
    """The recommended Pick or Place works in that state."""
    names = twin.action_names["humanoid"]
    better, done, could = read(text)
    assert (names[actions[-1]["humanoid"]], succeeded) == (done, could), text
    rewound(twin, task, actions)
    infos = twin.step({**actions[-1], "humanoid": names.index(better)})[-1]
    assert infos["humanoid"]["action_success"], (task, text)
    assert twin.world.held == task.item if better == "pick" else infos["humanoid"]["success"], (task, text)


def check_planner(twin: HouseholdEnv, task: Task, text: str, actions: list[dict[str, int]], succeeded: bool) -> None:
    """The recommended action shortens the optimal plan, and the one that was taken did not."""
    names = twin.action_names["humanoid"]
    better, done, could = read(text)
    assert (names[actions[-1]["humanoid"]], succeeded) == (done, could), text
    left = []
    for action in (actions[-1]["humanoid"], names.index(better)):
        rewound(twin, task, actions)
        before = len(twin.simulation.oracle.plan(twin.setting.goal))
        twin.step({**actions[-1], "humanoid": action})
        left.append(len(twin.simulation.oracle.plan(twin.setting.goal)) - before)
    assert left[0] >= 0 and left[1] == -1, (task, text, left)


def paper_feedback(env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float, steps: int) -> int:
    """Play a number of steps and check every sentence; return how many there were."""
    left, known, number = steps, 0, 0
    while left > 0:
        task = tasks[number % len(tasks)]
        for text, actions, succeeded in played(env, task, number, detours):
            left -= 1
            if text:
                known += 1
                check_paper(twin, task, text, list(actions), succeeded)
        number += 1
    return known


@pytest.mark.parametrize("detours", [1.0, 0.5])
def test_what_the_paper_style_recommends_works(
    env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float
) -> None:
    assert paper_feedback(env, twin, tasks, detours, 300) > 10


@pytest.mark.slow
@pytest.mark.parametrize("detours", [1.0, 0.5])
def test_what_the_paper_style_recommends_works_in_thousands_of_steps(
    env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float
) -> None:
    assert paper_feedback(env, twin, tasks, detours, 2000) > 80


def planner_feedback(env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], checks: int, detours: float) -> None:
    """Play episodes and check a number of their sentences; a step without one must have shortened the plan."""
    number = 0
    while checks > 0:
        task = tasks[number % len(tasks)]
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        before = len(env.simulation.oracle.plan(env.setting.goal))
        for text, actions, succeeded in played(env, task, number, detours):
            after = len(env.simulation.oracle.plan(env.setting.goal))
            assert (after < before) == (text == ""), (task, text, before, after)
            before = after
            if text and rng.random() < 0.3:
                checks -= 1
                check_planner(twin, task, text, list(actions), succeeded)
        number += 1


@pytest.mark.parametrize("detours", [1.0, 0.3])
def test_what_the_planner_style_recommends_is_optimal(
    planner_env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task], detours: float
) -> None:
    planner_feedback(planner_env, twin, tasks, 8, detours)


@pytest.mark.slow
def test_what_the_planner_style_recommends_is_optimal_in_thousands_of_steps(
    planner_env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task]
) -> None:
    planner_feedback(planner_env, twin, tasks, 100, 0.6)


def test_no_feedback_when_it_is_off(twin: HouseholdEnv, tasks: list[Task]) -> None:
    for text, *_ in played(twin, tasks[0], 0, 0.5):
        assert text == ""


def test_something_is_said_exactly_when_a_pick_or_place_was_missed(env: HouseholdEnv, tasks: list[Task]) -> None:
    """Told to have missed a pick or a place exactly when it was seen and would have worked."""
    known = 0
    for number, task in enumerate(tasks[:14]):
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        while env.agents:
            previous, humanoid, goal = env.outcome, env.simulation.oracle.robot, env.setting.goal
            action = int(rng.choice(10, p=[0.04] * 4 + [0.15, 0.01] + [0.17] * 4))
            name = env.action_names["humanoid"][action]
            verb = "place" if previous.held else "pick"
            could = humanoid.plan(verb, goal, previous.seen["humanoid"]) is not None
            observations, _, _, _, infos = env.step({"humanoid": action, "drone": int(rng.integers(9))})
            text = infos["humanoid"]["feedback"]
            assert infos["drone"]["feedback"] == ""
            assert bool(text) == (could and name != verb), (task.id, name, text)
            tokens = observations["humanoid"]["feedback"]
            assert language.UNKNOWN not in tokens
            assert np.count_nonzero(tokens) == len(language.words(text)), text
            known += bool(text)
    assert known > 20


def test_advice_leaves_the_world_alone(
    env: HouseholdEnv, planner_env: HouseholdEnv, twin: HouseholdEnv, tasks: list[Task]
) -> None:
    hashes = {
        (number, style): [state_hash(watched) for _ in played(watched, task, number, 0.5)]
        for number, task in enumerate(tasks[:3])
        for style, watched in (("paper", env), ("planner", planner_env), ("none", twin))
    }
    assert all(states == hashes[number, "none"] for (number, _), states in hashes.items())
