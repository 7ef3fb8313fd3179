"""The planner takes the least number of steps, leaves the world as it is, and its plans work in both executions."""

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pybullet
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.errors import OptionError, TaskError
from chmarl_pb.policies.policy import core_of
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.search import GrasperSearch, ScoutSearch, SearchPolicy
from chmarl_pb.policies.seats import masks_of
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.language import INSTRUCTION_LENGTH, tokenize
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task
from tests.helpers.small_homes import HOMES

MUG_TO_DESK = tokenize("Pick up the mug and put it on the desk.", INSTRUCTION_LENGTH)


@pytest.fixture(scope="module")
def simulated() -> Iterator[HouseholdEnv]:
    env = HouseholdEnv(execution="simulated")
    yield env
    env.close()


def act(env: HouseholdEnv, actions: list[str]) -> bool:
    """Play a task from its start, the drone staying; return whether it ends in success."""
    for name in actions:
        env.step(
            {"humanoid": env.action_names["humanoid"].index(name), "drone": env.action_names["drone"].index("stay")}
        )
    return env.outcome.success


def state_of(env: HouseholdEnv) -> tuple[object, ...]:
    return env.simulation.oracle.robot.pose, env.world.held, tuple(sorted(env.world.supports.items()))


def solved_within(env: HouseholdEnv, task: Task, steps: int) -> bool:
    """Return whether any sequence of that many actions of the humanoid succeeds: all are tried, by breadth.

    Two sequences that lead to the same state go on in the same way, so only one of them is followed.
    """
    env.reset(options={"task": task})
    frontier: list[list[str]] = [[]]
    known = {state_of(env)}
    for _ in range(steps):
        following = []
        for actions in frontier:
            for name in env.action_names["humanoid"][:-1]:  # staying leads nowhere
                env.reset(options={"task": task})
                if act(env, [*actions, name]):
                    return True
                if state_of(env) not in known:
                    known.add(state_of(env))
                    following.append([*actions, name])
        frontier = following
    return False


def test_plans_are_shortest_against_brute_force(env: HouseholdEnv, tasks: list[Task]) -> None:
    """Every sequence that is one step shorter than the plan fails; the plan succeeds."""
    short = [task for task in tasks if 2 <= task.optimal_steps <= 4]
    short.sort(key=lambda task: task.optimal_steps)
    for task in [*short[:2], *short[-2:]]:
        env.reset(options={"task": task})
        plan = env.simulation.oracle.plan(env.setting.goal)
        assert len(plan) == task.optimal_steps and act(env, plan), task
        assert not solved_within(env, task, len(plan) - 1), task


def signature(simulation: Simulation) -> dict[str, Any]:
    """Return all of a world's state that an episode depends on."""
    world, client = simulation.world, simulation.world.client
    world.sync()
    bodies = world.bodies.items()
    return {
        "bodies": {name: pybullet.getBasePositionAndOrientation(b, physicsClientId=client) for name, b in bodies},
        "objects": {name: world.pose(name) for name in world.objects},
        "held": world.held,
        "supports": dict(world.supports),
        "robots": (dict(world.state.grips), dict(world.robots)),
        "arm": simulation.oracle.robot.arm.configuration(),
        "constraints": pybullet.getNumConstraints(physicsClientId=client),
    }


def test_planning_leaves_the_world_as_it_is(simulation: Simulation, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == simulation.home.name)
    goal = simulation.begin(task).goal
    before = signature(simulation)
    plan = simulation.oracle.plan(goal)
    assert signature(simulation) == before
    simulation.oracle.robot.hold(goal.item, 0.3)
    held = signature(simulation)
    simulation.oracle.plan(goal)
    assert signature(simulation) == held
    assert simulation.solve(task).plans["humanoid"].actions == plan


def test_the_planner_refuses_what_cannot_be_done(simulation_of: Callable[[str], Simulation], tasks: list[Task]) -> None:
    simulation = simulation_of("home_1")
    task = next(task for task in tasks if task.home == "home_1")
    goal, before = simulation.begin(task).goal, simulation.begin(task)
    (x, y, _), quaternion = simulation.world.pose(goal.item)
    simulation.world.place(goal.item, (x, y, 2.4), quaternion, simulation.world.supports[goal.item].receptacle)
    high = signature(simulation)
    with pytest.raises(TaskError, match="cannot be reached"):
        simulation.oracle.plan(goal)
    assert signature(simulation) == high
    assert simulation.begin(task) == before


def test_nothing_to_do_when_x_is_on_y(simulation: Simulation, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == simulation.home.name)
    item = simulation.begin(task).goal.item
    assert simulation.oracle.plan(Goal(item, (simulation.world.supports[item].receptacle,))) == []


def symbolic(env: HouseholdEnv) -> tuple[object, ...]:
    return env.outcome, env.simulation.oracle.robot.pose, env.simulation.robots["drone"].pose


def both_executions(instant: HouseholdEnv, simulated: HouseholdEnv, task: Task) -> None:
    """The planner solves a task in L* steps; the other execution goes through the same outcomes."""
    episode = rollout(instant, make_policy("planner", instant), seed=0, task=task)
    assert episode.success and len(episode) == task.optimal_steps, task
    for env in (instant, simulated):
        env.reset(options={"task": task})
    for actions in episode.actions:
        for env in (instant, simulated):
            env.step(actions)
        assert symbolic(instant) == symbolic(simulated), task
    assert simulated.outcome.success


def test_planner_solves_tasks_in_both_executions(env: HouseholdEnv, simulated: HouseholdEnv, tasks: list[Task]) -> None:
    """The shortest of some in every third home; all homes and long ways are driven among the slow tests."""
    for home in HOMES[::3]:
        few = [task for task in tasks[:70] if task.home == home]
        both_executions(env, simulated, min(few, key=lambda task: task.optimal_steps))


def test_planner_solves_tasks(env: HouseholdEnv, tasks: list[Task]) -> None:
    policy = make_policy("planner", env)
    for task in tasks[7:40]:
        episode = rollout(env, policy, seed=0, task=task)
        assert episode.success and len(episode) == task.optimal_steps, task


@pytest.mark.slow
def test_planner_solves_200_tasks_in_both_executions(
    env: HouseholdEnv, simulated: HouseholdEnv, tasks: list[Task]
) -> None:
    for task in tasks[:200]:
        both_executions(env, simulated, task)


def test_planner_goes_on_from_a_detour(env: HouseholdEnv, tasks: list[Task]) -> None:
    """After random steps a plan from there succeeds."""
    for number, task in enumerate(tasks[:14]):
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        for _ in range(6):
            if env.agents:
                env.step({"humanoid": int(rng.integers(10)), "drone": int(rng.integers(9))})
        if env.agents:
            assert act(env, env.simulation.oracle.plan(env.setting.goal)), task


class BlindEnv:
    """An environment that shows a policy nothing but the names of its actions and rooms."""

    def __init__(self, env: HouseholdEnv):
        self.action_names, self.rooms = env.action_names, env.rooms

    def __getattr__(self, name: str) -> Any:
        raise AssertionError(f"the policy looked at env.{name}")


def test_search_policy_uses_only_what_the_robots_saw_and_told(tasks: list[Task]) -> None:
    """It plays from observations and action masks alone, on a home that it has never seen."""
    env = HouseholdEnv(split="test-unseen")
    blind = BlindEnv(env)
    policy = SearchPolicy(blind.action_names, blind.rooms)
    solved, played = 0, load_tasks("test-unseen")[:16]
    for number, task in enumerate(played):
        observations, infos = env.reset(seed=number, options={"task": task})
        policy.reset(number)
        while env.agents:
            observations, _, _, _, infos = env.step(policy.act(observations, masks_of(infos)))
        solved += env.outcome.success
    env.close()
    assert solved >= 0.7 * len(played), f"the search policy solved only {solved} of {len(played)}"


def test_each_search_depends_on_its_own_robot_alone(env: HouseholdEnv, tasks: list[Task]) -> None:
    policy, other = make_policy("search", env), make_policy("search", env)
    assert isinstance(policy, SearchPolicy) and isinstance(other, SearchPolicy)
    observations, infos = env.reset(options={"task": tasks[0]})
    policy.reset(0)
    other.reset(0)
    while env.agents:
        actions = policy.act(observations, infos)
        for name, search in other.parts.items():
            assert search.propose(observations[name], infos[name]) == actions[name]
            search.note(actions[name])
        observations, _, _, _, infos = env.step(actions)


def test_search_repeats_with_its_seed(env: HouseholdEnv, tasks: list[Task]) -> None:
    episodes = [rollout(env, make_policy("search", env), seed=5, task=tasks[3]) for _ in range(2)]
    assert episodes[0].actions == episodes[1].actions


def test_a_search_that_teaches_goes_on_from_what_was_done(env: HouseholdEnv, tasks: list[Task]) -> None:
    """One whose proposals are not followed proposes what it would do had it chosen the same actions itself."""
    names, rooms = env.action_names["humanoid"], env.rooms
    heard: dict[str, Any] = {"visible": ()}
    seen = {"self": np.eye(len(rooms) + 4)[0], "messages": np.zeros((2, len(rooms))), "instruction": MUG_TO_DESK}
    search = GrasperSearch(names, rooms)
    stay, goto = names.index("stay"), names.index(f"goto_{rooms[-1]}")
    assert [search.propose(seen, heard) for _ in range(3)] == [goto] * 3
    search.note(stay)
    assert search.propose(seen, heard) == goto  # nobody has gone there
    search.note(goto)
    there = seen | {"self": np.eye(len(rooms) + 4)[len(rooms) - 1]}
    proposed = search.propose(there, heard)
    other = names.index({"turn_left": "turn_right", "turn_right": "turn_left"}[names[proposed]])
    search.note(other)  # the first turn chooses the side
    for _ in range(10):
        assert search.propose(there, heard) == other
        search.note(stay)
        assert search.propose(there, heard) == other
        search.note(other)
    assert names[search.propose(there, heard)].startswith("goto_")


def test_failures_are_those_of_what_was_done() -> None:
    rooms = ("kitchen", "bedroom")
    search = GrasperSearch(("pick", "stay", "turn_left", "turn_right", "goto_bedroom"), rooms)
    seen = {"self": np.array([1.0, 0, 0, 0]), "messages": np.zeros((2, 2)), "instruction": MUG_TO_DESK}
    info = {"visible": ("mug_1",)}
    assert [search.propose(seen, info) for _ in range(3)] == [0] * 3
    search.note(1)
    assert search.propose(seen, info) == 0  # another action has been done
    search.note(0)
    assert search.propose(seen, info) != 0, "it holds nothing: its Pick was in vain"


def test_a_drone_that_teaches_goes_on_from_what_was_done(env: HouseholdEnv) -> None:
    names, rooms = env.action_names["drone"], env.rooms
    heard: dict[str, Any] = {"visible": ()}
    seen: dict[str, np.ndarray] = {"messages": np.zeros((2, len(rooms))), "instruction": MUG_TO_DESK}
    search = ScoutSearch(names, rooms)
    stay, gotos = names.index("stay"), [names.index(f"goto_{room}") for room in rooms]
    for done, wanted in ((stay, gotos[0]), (gotos[1], names.index("move_forward"))):
        search.note(done)
        assert search.propose(seen, heard) == wanted
    for _ in range(8):
        search.note(stay)
        search.note(search.propose(seen, heard))
    assert search.propose(seen, heard) == gotos[0]  # it was never there
    search.note(gotos[0])
    for _ in range(8):
        search.note(search.propose(seen, heard))
    assert search.propose(seen, heard) == gotos[2]


def test_teaching_alone_changes_no_proposal(env: HouseholdEnv, tasks: list[Task]) -> None:
    """A followed teacher proposes what the policy does."""
    policy, teacher = make_policy("search", env), make_policy("search", env)
    assert isinstance(teacher, SearchPolicy)
    observations, infos = env.reset(options={"task": tasks[2]})
    policy.reset(1)
    teacher.reset(1)
    while env.agents:
        actions = policy.act(observations, infos)
        assert teacher.propose(observations, infos) == teacher.propose(observations, infos) == actions
        teacher.note(actions)
        observations, _, _, _, infos = env.step(actions)


def test_policies_by_name(env: HouseholdEnv) -> None:
    assert core_of(env) is env
    with pytest.raises(OptionError, match=r"unknown policy 'oracle'.*random, .*search, .*planner"):
        make_policy("oracle", env)


def test_rollout_keeps_everything(env: HouseholdEnv, tasks: list[Task]) -> None:
    episode = rollout(env, make_policy("random", env), seed=1, task=tasks[2].id)
    assert len(episode) == len(episode.rewards) == len(episode.observations) - 1 == len(episode.infos) - 1
    assert episode.task == tasks[2]
    again = rollout(env, make_policy("random", env), seed=1, task=tasks[2])
    assert again.actions == episode.actions and (again.rewards == episode.rewards).all()
