"""The potential is CH-MARL's table, at every branch; rewards sum to its change."""

from dataclasses import replace
from itertools import chain, combinations, product

import numpy as np
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.outcome import Outcome, outcome_of, potential, reward
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import WorldState

NOBODY: set[str] = set()
HUMANOID, DRONE, BOTH = {"humanoid"}, {"drone"}, {"humanoid", "drone"}
GROUPS = [set(group) for group in chain.from_iterable(combinations(sorted(BOTH), n) for n in range(3))]


@pytest.mark.parametrize(
    ("grasped", "item_seen_by", "target_seen_by", "phi"),
    [
        (True, NOBODY, HUMANOID, 6),
        (True, NOBODY, BOTH, 6),
        (True, NOBODY, DRONE, 5),
        (True, BOTH, NOBODY, 4),
        (False, HUMANOID, NOBODY, 2),
        (False, BOTH, BOTH, 2),
        (False, DRONE, HUMANOID, 1),
        (False, NOBODY, BOTH, 0),
        (False, NOBODY, NOBODY, 0),
    ],
)
def test_table(grasped: bool, item_seen_by: set[str], target_seen_by: set[str], phi: float) -> None:
    assert potential(False, grasped, target_seen_by if grasped else item_seen_by, HUMANOID) == phi


@pytest.mark.parametrize(("grasped", "seen_by"), list(product((True, False), GROUPS)))
def test_success_is_worth_ten_whatever_else_holds(grasped: bool, seen_by: set[str]) -> None:
    assert potential(True, grasped, seen_by, HUMANOID) == 10


def test_visible_to_the_humanoid_means_to_any_robot_that_can_grasp() -> None:
    graspers = {"humanoid_0", "humanoid_1"}
    for grasped, high, low in ((False, 2, 1), (True, 6, 5)):
        assert potential(False, grasped, ["humanoid_1"], graspers) == high
        assert potential(False, grasped, ["scout", "humanoid_0"], graspers) == high
        assert potential(False, grasped, ["scout"], graspers) == low


@pytest.mark.parametrize(("item", "target"), list(product(GROUPS, GROUPS)))
def test_potential_looks_at_x_until_it_is_grasped_and_then_at_y(
    simulation: Simulation, tasks: list[Task], item: set[str], target: set[str]
) -> None:
    goal = simulation.begin(next(task for task in tasks if task.home == simulation.home.name)).goal
    seen: dict[str, tuple[str, ...]] = {
        robot: ((goal.item,) if robot in item else ()) + (goal.receptacles[:1] if robot in target else ())
        for robot in sorted(BOTH)
    }
    before = outcome_of(simulation.world.state, goal, seen, HUMANOID, simulation.room_names)
    simulation.oracle.robot.hold(goal.item)
    after = outcome_of(simulation.world.state, goal, seen, HUMANOID, simulation.room_names)
    assert before.potential == potential(False, False, item, HUMANOID)
    assert after.potential == potential(False, True, target, HUMANOID)


def test_reward_is_the_change_of_potential() -> None:
    first = Outcome(WorldState(), {}, "kitchen", 2.0, False)
    assert reward(first, replace(first, potential=6.0)) == 4
    assert reward(replace(first, potential=6.0), first) == -4


def test_judge_reads_the_world(simulation: Simulation, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == simulation.home.name)
    goal, world, rooms = simulation.begin(task).goal, simulation.world, simulation.room_names
    source = world.supports[goal.item].receptacle
    nothing: dict[str, tuple[str, ...]] = {"humanoid": (), "drone": ()}
    outcome = outcome_of(world.state, goal, nothing, HUMANOID, rooms)
    assert (outcome.potential, outcome.success, outcome.held) == (0, False, None)
    assert outcome.item_room == source.split("/")[0]
    assert outcome_of(world.state, goal, {"humanoid": (goal.item,), "drone": ()}, HUMANOID, rooms).potential == 2
    world.place(goal.item, *world.pose(goal.item), goal.receptacles[-1])
    assert outcome_of(world.state, goal, nothing, HUMANOID, rooms).success
    assert outcome_of(world.state, Goal(goal.item, (source,)), nothing, HUMANOID, rooms).success is False
    simulation.oracle.robot.hold(goal.item)
    held = outcome_of(world.state, goal, {"humanoid": (), "drone": goal.receptacles[:1]}, HUMANOID, rooms)
    room = rooms[simulation.world.robots["humanoid"].room]
    assert (held.potential, held.held, held.item_room, held.success) == (5, goal.item, room, False)


def test_outcome_does_not_change_with_the_world(simulation: Simulation, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == simulation.home.name)
    goal = simulation.begin(task).goal
    outcome = outcome_of(simulation.world.state, goal, {"humanoid": (), "drone": ()}, HUMANOID, simulation.room_names)
    kept = dict(outcome.supports)
    assert kept
    simulation.world.clear()
    assert outcome.supports == kept


def test_rewards_sum_to_the_change_of_potential(env: HouseholdEnv, tasks: list[Task]) -> None:
    for number, task in enumerate(tasks[:7]):
        rng = np.random.default_rng(number)
        _, infos = env.reset(options={"task": task})
        first, total = infos["humanoid"]["potential"], 0.0
        while env.agents:
            _, rewards, _, _, infos = env.step(
                {name: int(rng.integers(env.action_space(name).n)) for name in env.agents}
            )
            assert rewards["humanoid"] == rewards["drone"]
            total += rewards["humanoid"]
        assert total == infos["humanoid"]["potential"] - first
