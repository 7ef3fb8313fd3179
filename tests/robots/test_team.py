"""Teams of any mix: names, cells, rewards, feedback, planner, renderers; robots from files and of own classes."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.envs.joint import HumanoidEnv, JointEnv
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import AssetError, OptionError
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.mobile import MobileRobot
from chmarl_pb.robots.motion import Motion
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.tasks.setting import draw_starts

SCOUT = Path(__file__).parents[2] / "examples" / "scout" / "scout.toml"
FOUR = ("humanoid", "humanoid", "drone", "drone")
SPLIT = "val-unseen"


@pytest.fixture(scope="module")
def four() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split=SPLIT, robots=FOUR)
    yield env
    env.close()


@pytest.fixture(scope="module")
def scouting() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(("scene_graph", "depth"), split=SPLIT, robots=("humanoid", SCOUT), image_size=32)
    yield env
    env.close()


def no_ops(env: HouseholdEnv) -> dict[str, int]:
    return {name: names.index("stay") for name, names in env.action_names.items()}


def step(env: HouseholdEnv, **actions: str) -> tuple[Any, ...]:
    return env.step(no_ops(env) | {name: env.action_names[name].index(action) for name, action in actions.items()})


def cells(env: HouseholdEnv) -> dict[str, int]:
    return {name: robot.lattice.cell(robot.pose) for name, robot in env.simulation.robots.items()}


def share_no_cell(env: HouseholdEnv) -> bool:
    taken = cells(env)
    pairs = combinations(env.simulation.robots.values(), 2)
    return all(taken[a.name] != taken[b.name] for a, b in pairs if a.lattice is b.lattice)


def test_agents_are_named_by_kind_and_numbered_where_a_kind_repeats() -> None:
    assert list(team_of(TEAM)) == ["humanoid", "drone"]
    assert list(team_of(["drone", "humanoid", "drone"])) == ["drone_0", "humanoid", "drone_1"]
    assert list(team_of(["humanoid", SCOUT, find_model(SCOUT)])) == ["humanoid", "scout_0", "scout_1"]
    assert [catalog.class_of(name) for name in team_of(FOUR)] == [*FOUR]


@pytest.mark.parametrize(
    ("robots", "message"),
    [
        ((), "give 1 to 8 robots"),
        ("humanoid", "give 1 to 8 robots"),
        (("humanoid",) * 9, "give 1 to 8 robots"),
        (("drone",), "none can grasp"),
        (("humanoid", replace(find_model("drone"), name="humanoid")), "have one name"),
    ],
)
def test_teams_that_cannot_be_are_refused(robots: Any, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        chmarl_pb.parallel_env(robots=robots)


def test_the_benchmarks_team_is_the_default() -> None:
    given, usual = (chmarl_pb.parallel_env(split=SPLIT, **kw) for kw in ({"robots": ("humanoid", "drone")}, {}))
    for env in (given, usual):
        env.reset(seed=5)
    assert given.world.state.robots == usual.world.state.robots
    np.testing.assert_array_equal(given.state(), usual.state())
    assert "robots" not in usual.options.recorded() and "robots" not in given.options.recorded()


@pytest.mark.parametrize("robots", [("humanoid",), FOUR, ("humanoid", SCOUT)], ids=len)
def test_interfaces_hold_for_any_team(robots: Any) -> None:
    env = chmarl_pb.parallel_env(split=SPLIT, robots=robots)
    parallel_api_test(env, num_cycles=40)
    assert env.state().shape == env.state_space.shape and env.state_space.contains(env.state())
    env.close()
    for view in (JointEnv(split=SPLIT, robots=robots, flat_actions=len(robots) < 3), HumanoidEnv(robots=robots)):
        check_env(view, skip_render_check=True)
        view.close()


def test_robots_start_apart_and_stay_apart(four: HouseholdEnv) -> None:
    rng = np.random.default_rng(0)
    for seed in range(5):
        four.reset(seed=seed)
        assert share_no_cell(four)
        while four.agents:
            four.step({name: int(rng.integers(4)) for name in four.agents})  # Goto: all crowd into few rooms
            assert share_no_cell(four)


def test_starts_of_one_team_do_not_depend_on_who_is_added() -> None:
    lattices = tuple(chmarl_pb.parallel_env(split=SPLIT).simulation.robots[name].lattice for name in TEAM)
    for seed in range(50):
        pair = draw_starts(seed, lattices)
        assert draw_starts(seed, (*lattices, *lattices))[:2] == pair


def test_goto_takes_the_free_pose_nearest_to_the_anchor(four: HouseholdEnv) -> None:
    four.reset(seed=1)
    infos = step(four, humanoid_0="goto_kitchen", humanoid_1="goto_kitchen", drone_0="goto_kitchen")[-1]
    assert all(info["action_success"] for info in infos.values())
    lattice, robots = four.simulation.space.lattice, four.simulation.robots
    anchor = lattice.anchors["kitchen"]
    assert robots["humanoid_0"].pose == anchor
    away = np.linalg.norm(lattice.points - lattice.points[lattice.cell(anchor)], axis=1)
    second = robots["humanoid_1"].pose
    assert away[lattice.cell(second)] == np.sort(away)[1] and lattice.heading(second) == lattice.heading(anchor)
    assert robots["drone_0"].pose == four.simulation.space.drone_lattice.anchors["kitchen"], (
        "drones have cells of their own"
    )


def test_the_later_ones_move_into_one_cell_fails(four: HouseholdEnv) -> None:
    four.reset(seed=1)
    first, second = (four.simulation.robots[name] for name in ("humanoid_0", "humanoid_1"))
    forward = four.simulation.space.lattice.forward
    east, west = 0, 6  # they drive towards each other, into the cell between them
    cell = next(cell for cell in range(len(forward)) if forward[cell, east] >= 0 <= forward[forward[cell, east], east])
    middle = forward[cell, east]
    first.spawn(cell * 12 + east)
    second.spawn(int(forward[middle, east]) * 12 + west)
    infos = step(four, humanoid_0="move_forward", humanoid_1="move_forward")[-1]
    assert infos["humanoid_0"]["action_success"] and not infos["humanoid_1"]["action_success"]
    assert first.lattice.cell(first.pose) == middle
    before = four.world.state.robots["humanoid_0"]
    infos = step(four, humanoid_0="turn_left", humanoid_1="move_forward")[-1]
    assert not infos["humanoid_1"]["action_success"] and four.world.state.robots["humanoid_0"].base[0] == before.base[0]


def test_two_humanoids_never_pick_one_object(four: HouseholdEnv) -> None:
    four.reset(seed=3)
    item = four.setting.goal.item
    for name in ("humanoid_0", "humanoid_1"):
        robot = four.simulation.oracles[name].robot
        others = tuple(
            other.lattice.cell(other.pose) for other in four.simulation.robots.values() if other.name != name
        )
        robot.spawn(robot.stand(item, others) or 0)
    step(four)  # they look
    seen = [name for name in ("humanoid_0", "humanoid_1") if item in four.outcome.seen[name]]
    infos = step(four, humanoid_0="pick", humanoid_1="pick")[-1]
    assert sum(infos[name]["action_success"] for name in seen) == bool(seen)
    assert len(four.world.state.grips) == bool(seen)


def test_all_see_and_all_tell(four: HouseholdEnv) -> None:
    for seed in range(10):
        observations, infos = four.reset(seed=seed)
        item = four.setting.goal.item
        known = any(item in info["visible"] for info in infos.values())
        for observation in observations.values():
            assert observation["messages"][0].any() == known
        names = {name for info in infos.values() for name in info["visible"] if name in four.possible_agents}
        assert all(name not in infos[name]["visible"] for name in names), "a robot does not see itself"


def test_feedback_goes_to_the_robot_that_missed_something(four: HouseholdEnv) -> None:
    missed = 0
    for seed in range(8):
        four.reset(seed=seed)
        item, robot = four.setting.goal.item, four.simulation.oracles["humanoid_1"].robot
        robot.spawn(robot.stand(item) or 0)
        step(four)
        infos = step(four)[-1]
        if item in infos["humanoid_1"]["visible"]:
            missed += 1
            assert infos["humanoid_1"]["feedback"] and not infos["drone_0"]["feedback"]
    assert missed >= 4, "from where an object is picked it is mostly in view"


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_every_policy_drives_any_team(name: str, four: HouseholdEnv, scouting: HouseholdEnv) -> None:
    for env in (four, scouting):
        episode = chmarl_pb.rollout(env, chmarl_pb.make_policy(name, env), seed=1)
        assert set(episode.actions[0]) == set(env.possible_agents)
        assert episode.success or name != "planner"


def test_one_goal_is_reached_by_who_is_there_first(four: HouseholdEnv) -> None:
    for seed in range(4):
        four.reset(seed=seed)
        team = four.simulation.solve(four.task)
        alone = [len(oracle.plan(four.setting.goal, alone=True)) for oracle in four.simulation.oracles.values()]
        assert team.steps >= min(alone) and (team.steps == min(alone)) == team.proven
        episode = chmarl_pb.rollout(four, chmarl_pb.make_policy("planner", four), seed=seed, task=four.task)
        assert episode.success and episode.steps == team.steps


def test_two_humanoids_tidy_up_faster_than_one() -> None:
    steps = []
    for robots in (("humanoid", "drone"), ("humanoid", "humanoid", "drone")):
        env = chmarl_pb.parallel_env(split=SPLIT, robots=robots, task="tidy", max_steps=100)
        env.reset(seed=1)
        team = env.simulation.solve(env.task, env.options.kind)
        assert not team.proven, "several goals: an upper bound"
        episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed=1)
        assert episode.success
        steps.append(episode.steps)
        env.close()
    assert steps[1] < steps[0]


@pytest.mark.parametrize(
    "robots", [("humanoid", "humanoid", "drone"), (SCOUT, "humanoid", "drone")], ids=["two", "scout"]
)
def test_both_renderers_agree_on_any_team(robots: Any) -> None:
    envs = [chmarl_pb.parallel_env(split=SPLIT, robots=robots, renderer=renderer) for renderer in ("fast", "tiny")]
    rng = np.random.default_rng(4)
    for env in envs:
        env.reset(seed=7)
    for _ in range(4):
        actions = {name: int(rng.integers(env.action_space(name).n)) for name in envs[0].agents}
        steps = [env.step(actions) for env in envs]
        for name in envs[0].possible_agents:
            assert steps[0][-1][name]["visible"] == steps[1][-1][name]["visible"]
            fast, tiny = (env.simulation.renderer.picture(name, 48) for env in envs)
            for part in ("colour", "depth", "segmentation"):
                np.testing.assert_array_equal(getattr(fast, part), getattr(tiny, part))
    for env in envs:
        env.close()


def test_a_robot_file_gives_camera_footprint_and_class(scouting: HouseholdEnv) -> None:
    observations, _ = scouting.reset(seed=0)
    model = scouting.simulation.models["scout"]
    assert (model.class_name, model.camera.fov, model.footprint.radius, model.reach) == ("humanoid", 110, 0.2, None)
    assert len(scouting.simulation.robots["scout"].lattice.points) > len(scouting.simulation.space.lattice.points)
    (_, _, height), _ = model.eye(scouting.simulation.space, 0)
    assert height == pytest.approx(0.8) and observations["scout"]["depth"].shape == (32, 32)


def test_simulated_motions_of_a_team_end_as_instant_ones() -> None:
    ends = []
    for execution in ("instant", "simulated"):
        env = chmarl_pb.parallel_env(split=SPLIT, robots=("humanoid", SCOUT, "humanoid"), execution=execution)
        chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed=3)
        ends.append(env.world.state)
        env.close()
    assert ends[0] == ends[1]


class Hovering(MobileRobot):
    """A robot of one's own that refuses to move backward."""

    def plan(self, action: str, *rest: Any, **named: Any) -> Motion | None:
        return None if action == "move_backward" else super().plan(action, *rest, **named)


def test_a_robot_class_of_ones_own() -> None:
    model = replace(find_model("drone"), name="hovering", make=Hovering)
    env = chmarl_pb.parallel_env(split=SPLIT, robots=("humanoid", model))
    env.reset(seed=0)
    assert not step(env, hovering="move_backward")[-1]["hovering"]["action_success"]
    assert step(env, hovering="goto_bedroom")[-1]["hovering"]["action_success"]
    with pytest.raises(AssetError, match="derive it from MobileManipulator"):
        chmarl_pb.parallel_env(robots=("humanoid", replace(model, reach=find_model("humanoid").reach)))
    env.close()
