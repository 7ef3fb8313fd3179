"""The world: objects, physics of putting down, holding; exact and the same after any history."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pybullet
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.navigation.free_space import Space, space_of
from chmarl_pb.robots.arm import Arm
from chmarl_pb.robots.file import find_model
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.world import UPRIGHT, Grip, Pose, RobotBody, RobotState, Support, World, yaw_quaternion

ITEMS = ("mug_1", "plate_1", "wine_bottle_1", "banana_1", "sports_ball_1", "teddy_bear_1")
FLOOR = (1.0, 1.0, 0.0)


@pytest.fixture(scope="module")
def home() -> Home:
    return load_home("home_1")


@pytest.fixture(scope="module")
def space(home: Home) -> Space:
    return space_of(home)


@pytest.fixture
def world(home: Home) -> Iterator[World]:
    world = World(home)
    yield world
    world.close()


def place_on(space: Space, world: World, item: str, number: int = 0) -> tuple[str, tuple[float, ...], float]:
    """Return a receptacle, position and yaw where an object fits."""
    fitting = [name for name in space.home.receptacles if len(space.places(name, world.size(item)))]
    receptacle = fitting[number % len(fitting)]
    places = space.places(receptacle, world.size(item))
    x, y, z, yaw = places[(97 * number + len(places) // 2) % len(places)].tolist()
    return receptacle, (x, y, z), yaw


def set_down(world: World, item: str, position: tuple[float, ...], yaw: float, receptacle: str) -> bool:
    """Let a robot hold an object, and set it down."""
    if "gripper" not in world.robots:
        model = find_model("humanoid")
        body = model.load(world.client)
        world.add_robot("gripper", RobotBody(body, (), Arm(world.client, body, model.urdf).grasp_link))
        world.set_robot("gripper", RobotState(0, 0, 0, (FLOOR, UPRIGHT)))
    world.hold("gripper", Grip(item, 0.0), (FLOOR, UPRIGHT))
    return world.set_down("gripper", position, yaw, receptacle)


def put(space: Space, world: World, item: str, number: int = 0) -> Pose:
    """Put an object from the floor onto an empty receptacle and return where it settled."""
    world.clear()
    receptacle, position, yaw = place_on(space, world, item, number)
    assert set_down(world, item, position, yaw, receptacle)
    assert world.supports[item] == Support(receptacle, position[2])
    return world.pose(item)


def edge_of(space: Space, world: World, item: str) -> tuple[str, tuple[float, float, float]]:
    """Return a receptacle and a place at the edge of its top, from which an object tips over."""
    name = next(name for name, thing in space.home.receptacles.items() if thing.class_name == "kitchen_table")
    thing = space.home.receptacles[name]
    top = max(thing.solids, key=lambda solid: solid.top)
    x = top.polygon.mean(axis=0)[0]
    return name, (float(x), float(top.high[1] + 0.2 * min(world.size(item)[:2])), top.top)


@pytest.mark.parametrize("item", ITEMS)
def test_an_object_settles_where_it_is_put(space: Space, world: World, item: str) -> None:
    for number in range(4):
        _, position, yaw = place_on(space, world, item, number)
        settled = put(space, world, item, number)
        assert np.allclose(settled[0], position, atol=3e-3)
        assert abs(np.dot(settled[1], yaw_quaternion(yaw))) > np.cos(0.02)
        assert np.allclose(world.physics.read_object(item)[0], settled[0], atol=1e-6)


def test_an_object_that_tips_over_goes_back(space: Space, world: World) -> None:
    item = "wine_bottle_1"
    put(space, world, item, 3)
    receptacle, position = edge_of(space, world, item)
    assert not set_down(world, item, position, 0.0, receptacle)
    assert world.state.held == (item,) and item not in world.supports
    world.sync()
    assert np.allclose(world.physics.read_object(item)[0], FLOOR, atol=1e-6)


def test_an_object_is_carried_by_what_it_stands_on_only(space: Space, world: World) -> None:
    receptacle, position, yaw = place_on(space, world, "mug_1")
    other = next(name for name in space.home.receptacles if name != receptacle)
    assert not set_down(world, "mug_1", position, yaw, other)
    assert "mug_1" not in world.supports


def test_settling_is_the_same_after_any_history(space: Space, home: Home, world: World) -> None:
    fresh = {(item, number): put(space, world, item, number) for item in ITEMS for number in range(3)}
    old = World(home)
    humanoid = MobileManipulator(find_model("humanoid"), old, space, "humanoid")
    rng = np.random.default_rng(0)
    try:
        for index in rng.permutation(len(fresh)):
            item, number = list(fresh)[index]
            humanoid.spawn(int(rng.integers(12 * len(space.lattice.points))))
            humanoid.arm.drive(rng.uniform(-1, 1, len(Arm.rest)))
            for _ in range(int(rng.integers(20))):
                old.physics.step()
            assert put(space, old, item, number) == fresh[item, number]
    finally:
        old.close()


def test_worlds_do_not_touch_each_other(space: Space, home: Home, world: World) -> None:
    other = World(home)
    try:
        settled = put(space, other, "mug_1")
        world.place("mug_1", FLOOR, UPRIGHT)
        world.sync()
        world.physics.step()
        assert other.pose("mug_1") == settled
        assert world.objects == other.objects == ["mug_1"]
        world.close()
        assert put(space, other, "mug_1") == settled
    finally:
        other.close()
    other.close()


def test_taken_is_a_touch_of_turned_boxes(world: World) -> None:
    width, depth, height = world.size("book_1")
    world.place("book_1", (2.0, 2.0, 0.5), yaw_quaternion(0.3))
    size = (0.1, 0.1, 0.1)
    along = np.array([np.cos(0.3), np.sin(0.3)])
    free, near = width / 2 + 0.05 + 0.02, width / 2 + 0.05 + 0.005
    places = np.array(
        [
            [2.0, 2.0, 0.5, 0.0],
            [*(2.0 + near * along), 0.5, 0.3],
            [*(2.0 + free * along), 0.5, 0.3],
            [2.0, 2.0, 0.5 + height + 0.01, 0.0],
            [2.0, 2.0 + width + depth + 1.0, 0.5, 0.0],
        ]
    )
    assert world.taken(places, size).tolist() == [True, True, False, False, False]
    assert not world.taken(places, size, ignoring=("book_1",)).any()


def test_clear_parks_all_objects(space: Space, world: World) -> None:
    parked = world.physics.read_object("mug_1")
    put(space, world, "mug_1")
    world.sync()
    assert world.physics.read_object("mug_1") != parked
    assert world.objects == ["mug_1"] and "mug_1" in world.bodies
    world.clear()
    assert not world.objects and not world.supports and "mug_1" not in world.bodies
    world.sync()
    assert world.physics.read_object("mug_1") == parked


def test_every_change_is_a_new_state_and_leaves_the_earlier_one(space: Space, world: World) -> None:
    humanoid = MobileManipulator(find_model("humanoid"), world, space, "humanoid")
    receptacle, position, yaw = place_on(space, world, "mug_1")
    changes = {
        "place": lambda: world.place("mug_1", FLOOR, UPRIGHT),
        "hold": lambda: humanoid.hold("mug_1"),
        "drive": lambda: humanoid.spawn(5),
        "set down": lambda: world.set_down("humanoid", position, yaw, receptacle),
        "clear": world.clear,
    }
    for name, change in changes.items():
        state, text = world.state, repr(world.state)
        change()
        assert world.state is not state and repr(state) == text, name
    humanoid.spawn(5)
    before = world.state
    humanoid.spawn(5)
    world.sync()
    world.physics.step()
    assert world.state is before


def test_parts_that_do_not_change_stay_the_same_objects(space: Space, world: World) -> None:
    humanoid = MobileManipulator(find_model("humanoid"), world, space, "humanoid")
    world.place("mug_1", FLOOR, UPRIGHT)
    before = world.state
    humanoid.spawn(3)
    assert world.state.objects is before.objects and world.state.grips is before.grips
    humanoid.hold("mug_1")
    before = world.state
    humanoid.spawn(7)
    assert world.state.objects is not before.objects
    assert world.state.objects.supports is before.objects.supports and world.state.grips is before.grips


def test_an_earlier_state_comes_back_whole(space: Space, world: World) -> None:
    humanoid = MobileManipulator(find_model("humanoid"), world, space, "humanoid")

    def physics() -> tuple[Any, ...]:
        world.sync()
        objects = {name: world.physics.read_object(name) for name in world.physics.objects}
        count = pybullet.getNumConstraints(physicsClientId=world.client)
        return objects, world.physics.read_base("humanoid"), humanoid.arm.configuration(), count

    put(space, world, "mug_1")
    humanoid.spawn(5)
    standing, at_rest = world.state, physics()
    humanoid.hold("mug_1")
    holding, in_hand = world.state, physics()
    assert in_hand[3] == 1
    for state, shown in ((standing, at_rest), (holding, in_hand), (standing, at_rest)):
        humanoid.spawn(9)
        for _ in range(3):
            world.physics.step()
        world.moved()
        world.state = state
        assert physics() == shown


def test_a_held_object_follows_the_hand_until_released(space: Space, world: World) -> None:
    humanoid, physics = MobileManipulator(find_model("humanoid"), world, space, "humanoid"), world.physics
    world.place("mug_1", FLOOR, UPRIGHT)
    humanoid.hold("mug_1")
    assert world.held == "mug_1"
    world.sync()
    physics.thaw("mug_1", solid=False)
    for _ in range(48):
        humanoid.arm.drive(Arm.carry)
        physics.step()
    position, _ = physics.read_object("mug_1")
    assert np.allclose(position, humanoid.held_pose(world.state.grips["humanoid"])[0], atol=2e-3)
    physics.release("humanoid")
    for _ in range(48):
        physics.step()
    assert physics.read_object("mug_1")[0][2] < position[2] - 0.15
    physics.freeze("mug_1")


def test_only_a_solid_object_is_stopped_by_others(space: Space, world: World) -> None:
    heights, physics = {}, world.physics
    for solid in (False, True):
        put(space, world, "mug_1")
        world.sync()
        physics.thaw("mug_1", solid=solid)
        for _ in range(60):
            physics.step()
        heights[solid] = physics.read_object("mug_1")[0][2] - world.pose("mug_1")[0][2]
        physics.freeze("mug_1")
        world.moved()
    assert heights[True] == pytest.approx(0, abs=1e-3)
    assert heights[False] < -0.2


def test_bodies_are_where_they_belong_after_a_sync_and_only_then(world: World) -> None:
    item, places = "mug_1", [world.physics.read_object("mug_1")[0]]
    for x in (1.0, 2.0, 3.0):
        world.place(item, (x, 1.0, 1.0), yaw_quaternion(x))
        assert world.client == world.physics.client and world.bodies[item] and world.physics
        assert world.physics.read_object(item)[0] == places[-1]
        world.sync()
        position, quaternion = world.physics.read_object(item)
        np.testing.assert_allclose(position, (x, 1.0, 1.0), atol=1e-6)
        np.testing.assert_allclose(quaternion, yaw_quaternion(x), atol=1e-6)
        places.append(position)


def test_the_client_has_every_robot_in_its_place_after_a_sync() -> None:
    env = HouseholdEnv(split="val-unseen")
    try:
        env.reset(seed=0)
        world = env.world
        client = world.client
        for action in ("goto_kitchen", "goto_bedroom", "goto_bathroom"):
            env.step({name: env.action_names[name].index(action) for name in env.agents})
            world.sync()
            for name, robot in world.robots.items():
                position, _ = pybullet.getBasePositionAndOrientation(world.bodies[name], physicsClientId=client)
                assert np.allclose(position[:2], robot.base[0][:2], atol=1e-4)
    finally:
        env.close()
