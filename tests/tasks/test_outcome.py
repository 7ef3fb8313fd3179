"""The potential is CH-MARL's table, at every branch; rewards sum to its change."""

from dataclasses import replace
from itertools import chain, combinations, product

import numpy as np
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.outcome import Outcome, judge, potential, reward
from chmarl_pb.tasks.simulation import Stage
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import WorldState

NOBODY: set[str] = set()
HUMANOID, DRONE, BOTH = {"humanoid"}, {"drone"}, {"humanoid", "drone"}
GROUPS = [set(group) for group in chain.from_iterable(combinations(sorted(BOTH), n) for n in range(3))]
BRANCHES = list(product((True, False), GROUPS, GROUPS))


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
    assert potential(False, grasped, item_seen_by, target_seen_by) == phi


@pytest.mark.parametrize(("grasped", "item", "target"), BRANCHES)
def test_success_is_worth_ten_whatever_else_holds(grasped: bool, item: set[str], target: set[str]) -> None:
    assert potential(True, grasped, item, target) == 10


@pytest.mark.parametrize(("grasped", "item", "target"), BRANCHES)
def test_potential_looks_at_x_until_it_is_grasped_and_then_at_y(
    grasped: bool, item: set[str], target: set[str]
) -> None:
    for other in GROUPS:
        changed = (item, other) if not grasped else (other, target)
        assert potential(False, grasped, *changed) == potential(False, grasped, item, target)


def test_reward_is_the_change_of_potential() -> None:
    first = Outcome(WorldState(), {}, "kitchen", 2.0, False)
    assert reward(first, replace(first, potential=6.0)) == 4
    assert reward(replace(first, potential=6.0), first) == -4


def test_judge_reads_the_world(stage: Stage, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == stage.home.name)
    goal, world = stage.begin(task).goal, stage.world
    source = world.supports[goal.item].receptacle
    nothing: dict[str, tuple[str, ...]] = {"humanoid": (), "drone": ()}
    outcome = judge(world.state, goal, nothing, "hallway")
    assert (outcome.potential, outcome.success, outcome.held) == (0, False, None)
    assert outcome.item_room == source.split("/")[0]
    assert judge(world.state, goal, {"humanoid": (goal.item,), "drone": ()}, "hallway").potential == 2
    world.place(goal.item, *world.pose(goal.item), goal.receptacles[-1])
    assert judge(world.state, goal, nothing, "hallway").success
    assert judge(world.state, Goal(goal.item, (source,)), nothing, "hallway").success is False
    stage.humanoid.hold(goal.item)
    held = judge(world.state, goal, {"humanoid": (), "drone": goal.receptacles[:1]}, "hallway")
    assert (held.potential, held.held, held.item_room, held.success) == (5, goal.item, "hallway", False)


def test_outcome_does_not_change_with_the_world(stage: Stage, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == stage.home.name)
    goal = stage.begin(task).goal
    outcome = judge(stage.world.state, goal, {"humanoid": (), "drone": ()}, "kitchen")
    kept = dict(outcome.supports)
    assert kept
    stage.world.clear()
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
