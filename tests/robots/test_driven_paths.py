"""Driven arms keep clear of what stands there: depths agree with PyBullet, paths are free, collisions are counted."""

from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pybullet
import pytest
from numpy.typing import ArrayLike

from benchmarks.collisions import Probe, play
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.homes.home import load_home
from chmarl_pb.navigation.lattice import FOOTPRINT
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.robots.arm import Arm
from chmarl_pb.robots.arm_boxes import ArmBoxes
from chmarl_pb.robots.clearance import Obstacles
from chmarl_pb.robots.execution import DEEP, Snapshot, collisions
from chmarl_pb.robots.planning import Path, find_path, line, search
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.robots.surroundings import Surroundings
from chmarl_pb.robots.travel import choose_postures
from chmarl_pb.tasks.splits import find_task
from chmarl_pb.world import World, yaw_quaternion


@pytest.fixture(scope="module")
def world() -> Iterator[World]:
    world = World(load_home("home_1"))
    yield world
    world.close()


def test_depths_agree_with_closest_points(world: World) -> None:
    model = team_of(TEAM)["humanoid"]
    body = model.load(world.client)
    arm, shape, rng = Arm(world.client, body, model.urdf), ArmBoxes(world.client, body), np.random.default_rng(0)
    configurations = rng.uniform(arm.lower, arm.upper, (60, 10))
    bases = np.column_stack([rng.uniform(*world.home.bounds, (60, 2)), rng.uniform(-3, 3, 60)])
    solids = Obstacles((solid.polygon, solid.bottom, solid.top) for solid in world.home.solids)
    found = solids.depth(shape.place(configurations)[0].at(*bases.T))
    links = {
        pybullet.getJointInfo(body, number, physicsClientId=world.client)[12].decode(): number
        for number in range(pybullet.getNumJoints(body, physicsClientId=world.client))
    }
    floors = {number for name, number in world.links.items() if "/floor" in name}
    touched = 0
    for configuration, (x, y, yaw), depths in zip(configurations, bases.tolist(), found, strict=True):
        pybullet.resetBasePositionAndOrientation(body, (x, y, 0), yaw_quaternion(yaw), physicsClientId=world.client)
        arm.set(configuration.tolist())
        for name, depth in zip(shape.links, depths, strict=True):
            points = pybullet.getClosestPoints(
                body, world.physics.home, 0.0, links[name], physicsClientId=world.client
            )  # fmt: skip
            true = max([-point[8] for point in points if point[4] not in floors], default=0.0)
            assert depth == pytest.approx(max(true, 0.0), abs=0.004)
            touched += depth > 0.01
    pybullet.removeBody(body, physicsClientId=world.client)
    assert touched > 20


def wall(postures: np.ndarray, margin: float) -> np.ndarray:
    """Return how deep points of a plane stand in a wall at x = 0 that leaves y > 0.5 free."""
    x, y = postures.T
    depths: np.ndarray = np.maximum(0.0, np.minimum(0.1 - np.abs(x), 0.5 - y) + margin)
    return depths


START, GOAL = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
LIMITS = np.array([-2.0, -2.0]), np.array([2.0, 2.0])


@pytest.mark.parametrize("ways", [[np.array([0.0, 2.0])], [np.array([-1.0, 1.5]), np.array([1.0, 1.5])], []])
def test_a_path_goes_round(ways: list[np.ndarray]) -> None:
    path = find_path(wall, START, [GOAL], ways, LIMITS)
    assert path.depth == 0
    corners = [START, *path.postures]
    assert (corners[-1] == GOAL).all()
    for one, other in pairwise(corners):
        assert wall(line(one, other), 0.0).max() <= 0.003
    again = find_path(wall, START, [GOAL], ways, LIMITS)
    assert np.array_equal(path.postures, again.postures)


def test_a_search_finds_the_ends_that_a_path_connects() -> None:
    inside = np.array([0.0, 0.0])
    found = search(wall, ([inside, START], [inside, GOAL]), [], LIMITS)
    assert found is not None and found[:2] == (1, 1)
    assert found[2].depth == 0 and found[2].postures[-1] is GOAL


def test_where_there_is_no_way_the_path_says_how_deep_it_is() -> None:
    path = find_path(lambda postures, margin: np.maximum(0.0, 0.1 - np.abs(postures[:, 0])), START, [GOAL], [], LIMITS)
    assert path is not None and path.postures[-1] is GOAL and path.depth == pytest.approx(0.1, abs=0.06)


def test_the_posture_changes_for_the_leg_that_needs_it() -> None:
    legs = [np.column_stack([np.full(9, float(number)), np.zeros((9, 2))]) for number in range(3)]
    options = [np.array([0.0]), np.array([1.0])]

    def along(postures: np.ndarray, bases: np.ndarray, margin: float) -> np.ndarray:
        return np.where((bases[..., 0] == 1) & (postures[..., 0] == 0), 0.2, 0.0)

    def choose(change_depth: float, starts: list[int], ends: list[int]) -> tuple[int, list[int], float]:
        start, chosen = choose_postures(
            legs,
            starts,
            ends,
            options,
            along,
            lambda one, other, base, searching: Path((other,), change_depth),
            (np.zeros(1), np.ones(1)),
        )
        return start, [leg.option for leg in chosen], max(max(leg.depth, leg.path.depth) for leg in chosen)

    assert choose(0.0, [0, 1], [0]) == (0, [0, 1, 0], 0.0)
    assert choose(0.1, [0, 1], [0, 1]) == (1, [1, 1, 1], 0.0), "begins in another where the first cannot be left"
    assert choose(0.1, [0], [0]) == (0, [0, 1, 0], 0.1)


def test_postures_are_drawn_for_a_leg_on_which_none_of_the_usual_ones_is_free() -> None:
    legs = [np.column_stack([np.full(9, float(number)), np.zeros((9, 2))]) for number in range(3)]
    limits = np.array([-1.0, 0.0]), np.array([2.0, 0.0])

    def along(postures: np.ndarray, bases: np.ndarray, margin: float) -> np.ndarray:
        return np.where((bases[..., 0] == 1) & (postures[..., 0] < 1.5), 0.2, 0.0)

    def change(one: np.ndarray, other: np.ndarray, base: np.ndarray, searching: bool) -> Path:
        return Path((other,), 0.0 if searching else 0.5)  # no change is free until it is searched for

    options = [np.array([0.0, 0.0]), np.array([1.0, 0.0])]
    start, chosen = choose_postures(legs, [0], [0], options, along, change, limits)
    assert start == 0
    assert [leg.option for leg in chosen][::2] == [0, 0]
    assert chosen[1].option >= len(options)
    assert chosen[1].path.postures[-1][0] >= 1.5
    assert all(leg.depth == 0 and leg.path.depth == 0 for leg in chosen)


def test_the_last_postures_are_within_the_footprint(world: World) -> None:
    body = team_of(TEAM)["humanoid"].load(world.client)
    shape = ArmBoxes(world.client, body)
    pybullet.removeBody(body, physicsClientId=world.client)
    sizes = [(0.01, 0.01, 0.01), *(world.size(f"{name}_1") for name in world.home.catalog.graspables)]
    corners = np.array(list(product((-1, 1), repeat=3)))
    for options, grasped in ((Arm.postures.empty, sizes[:1]), (Arm.postures.loaded, sizes)):
        boxes, grasp = shape.place([options[-1]])
        assert shape.own_depths(boxes, np.array([options[-1][0]]))[0] == 0
        points = boxes.middles[0][:, None] + np.einsum("bij,bkj->bki", boxes.axes[0], corners * boxes.halves[:, None])
        assert np.hypot(*points[..., :2].reshape(-1, 2).T).max() < FOOTPRINT.radius - 0.005
        for width, depth, _ in grasped:
            assert (
                np.hypot(*grasp[0, :2]) + np.hypot(width, depth) / 2 < FOOTPRINT.radius or options is Arm.postures.empty
            )


@pytest.mark.parametrize(("task", "step"), [("train-3000", 6), ("val-unseen-000", 3)])
def test_motions_that_went_through_furniture_are_free(task: str, step: int) -> None:
    """The arm hit a wall on the drive by 135 mm, and the fridge beside what was picked by 142 mm."""
    states = []
    for execution in ("instant", "simulated"):
        env = HouseholdEnv(home=find_task(task).home)
        observations, infos = env.reset(options={"task": find_task(task)})
        policy = make_policy("planner", env)
        policy.reset(0)
        for number in range(step + 1):
            if number == step:
                env.options = replace(env.options, execution=execution)
            observations, _, _, _, infos = env.step(policy.act(observations, infos))
        states.append(env.world.state)
        assert env.collisions == 0
        env.close()
    assert states[0] == states[1]


@pytest.mark.parametrize("blind", [False, True])
def test_the_count_agrees_with_a_second_client(monkeypatch: pytest.MonkeyPatch, blind: bool) -> None:
    """A robot that plans as if nothing were there goes through things, and each such motion is counted."""
    if blind:
        monkeypatch.setattr(Surroundings, "depths", lambda self, postures, bases, touching: nothing(postures, bases))
    env = HouseholdEnv(home="home_4", execution="simulated")
    env.reset(seed=0)
    probe = Probe(env)
    motions = play(env, probe, 0)["motions"]
    deep = [max(motion["depths"].values(), default=0.0) > DEEP for motion in motions]
    assert [motion["counted"] > 0 for motion in motions] == deep
    assert any(deep) == blind and env.collisions == sum(deep)
    probe.close()
    env.close()


def nothing(postures: ArrayLike, bases: ArrayLike) -> np.ndarray:
    return np.zeros(max(len(np.atleast_2d(postures)), len(np.atleast_2d(bases))))


def test_robots_that_pass_through_something_are_counted() -> None:
    depths = [
        {"humanoid": 0.0, "drone": 0.0},
        {"humanoid": 2 * DEEP, "drone": 0.0},
        {"humanoid": DEEP / 2, "drone": 0.0},
    ]
    snapshots = [Snapshot({}, {}, {}, depth) for depth in depths]
    assert collisions(snapshots) == 1 and collisions(snapshots[::2]) == 0 and collisions(()) == 0
