"""The world: objects, physics of putting down, holding; exact and the same after any history."""

from collections.abc import Iterator

import numpy as np
import pybullet
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.navigation.free_space import Space, space_of
from chmarl_pb.robots.arm import Arm
from chmarl_pb.robots.humanoid import Humanoid
from chmarl_pb.world import UPRIGHT, Pose, Support, World, yaw_quaternion

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


def put(space: Space, world: World, item: str, number: int = 0) -> Pose:
    """Put an object from the floor onto an empty receptacle and return where it settled."""
    world.clear()
    receptacle, position, yaw = place_on(space, world, item, number)
    world.place(item, FLOOR, UPRIGHT)
    assert world.set_down(item, position, yaw, receptacle)
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
        assert np.allclose(world.read_pose(item)[0], settled[0], atol=1e-6)


def test_an_object_that_tips_over_goes_back(space: Space, world: World) -> None:
    item = "wine_bottle_1"
    put(space, world, item, 3)
    before = (world.pose(item), world.read_pose(item), dict(world.supports))
    receptacle, position = edge_of(space, world, item)
    assert not world.set_down(item, position, 0.0, receptacle)
    assert (world.pose(item), world.read_pose(item), world.supports) == before


def test_an_object_is_carried_by_what_it_stands_on_only(space: Space, world: World) -> None:
    receptacle, position, yaw = place_on(space, world, "mug_1")
    other = next(name for name in space.home.receptacles if name != receptacle)
    world.place("mug_1", FLOOR, UPRIGHT)
    assert not world.set_down("mug_1", position, yaw, other)
    assert "mug_1" not in world.supports


def test_settling_is_the_same_after_any_history(space: Space, home: Home, world: World) -> None:
    fresh = {(item, number): put(space, world, item, number) for item in ITEMS for number in range(3)}
    old = World(home)
    humanoid = Humanoid(old, space)
    rng = np.random.default_rng(0)
    try:
        for index in rng.permutation(len(fresh)):
            item, number = list(fresh)[index]
            humanoid.spawn(int(rng.integers(12 * len(space.lattice.points))))
            humanoid.arm.drive(rng.uniform(-1, 1, len(Arm.rest)))
            for _ in range(int(rng.integers(20))):
                old.step()
            assert put(space, old, item, number) == fresh[item, number]
    finally:
        old.close()


def test_worlds_do_not_touch_each_other(space: Space, home: Home, world: World) -> None:
    other = World(home)
    try:
        settled = put(space, other, "mug_1")
        world.place("mug_1", FLOOR, UPRIGHT)
        world.step()
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
    assert not world.taken(places, size, ignoring="book_1").any()


def test_clear_parks_all_objects(space: Space, world: World) -> None:
    parked = world.read_pose("mug_1")
    put(space, world, "mug_1")
    assert world.objects == ["mug_1"] and "mug_1" in world.bodies
    world.clear()
    assert not world.objects and not world.supports and "mug_1" not in world.bodies
    assert world.read_pose("mug_1") == parked


def test_every_change_is_a_new_version(space: Space, world: World) -> None:
    humanoid = Humanoid(world, space)
    receptacle, position, yaw = place_on(space, world, "mug_1")
    changes = {
        "place": lambda: world.place("mug_1", FLOOR, UPRIGHT),
        "set down": lambda: world.set_down("mug_1", position, yaw, receptacle),
        "hold": lambda: humanoid.hold("mug_1"),
        "release": world.release,
        "clear": world.clear,
    }
    for name, change in changes.items():
        before = world.version
        change()
        assert world.version > before, name
    before = world.version
    world.clear()
    world.release()
    world.step()
    assert world.version == before


def test_a_held_object_follows_the_hand_until_released(space: Space, world: World) -> None:
    humanoid = Humanoid(world, space)
    humanoid.spawn(0)
    world.place("mug_1", FLOOR, UPRIGHT)
    humanoid.hold("mug_1")
    assert world.held == "mug_1"
    world.thaw("mug_1", solid=False)
    for _ in range(48):
        humanoid.arm.drive(Arm.carry)
        world.step()
    assert np.allclose(world.read_pose("mug_1")[0], humanoid.held_pose("mug_1")[0], atol=2e-3)
    height = world.read_pose("mug_1")[0][2]
    world.release()
    for _ in range(48):
        world.step()
    assert world.held is None
    assert world.read_pose("mug_1")[0][2] < height - 0.15
    world.freeze("mug_1")


def test_only_a_solid_object_is_stopped_by_others(space: Space, world: World) -> None:
    heights = {}
    for solid in (False, True):
        put(space, world, "mug_1")
        world.thaw("mug_1", solid=solid)
        for _ in range(60):
            world.step()
        heights[solid] = world.read_pose("mug_1")[0][2] - world.pose("mug_1")[0][2]
        world.freeze("mug_1")
    assert heights[True] == pytest.approx(0, abs=1e-3)
    assert heights[False] < -0.2


def test_bodies_are_where_they_belong_whenever_somebody_asks(space: Space, world: World) -> None:
    world.clear()
    item = "mug_1"
    for x in (1.0, 2.0, 3.0):
        world.place(item, (x, 1.0, 1.0), yaw_quaternion(x))
        position, quaternion = world.read_pose(item)
        np.testing.assert_allclose(position, (x, 1.0, 1.0), atol=1e-6)
        np.testing.assert_allclose(quaternion, yaw_quaternion(x), atol=1e-6)


def test_a_layout_counts_until_something_changes(space: Space, world: World) -> None:
    world.clear()
    world.layout = layout = object()
    assert world.layout is layout
    world.place("mug_1", (1.0, 1.0, 1.0), UPRIGHT)
    assert world.layout is None


def test_kept_client_sees_every_robot_in_its_place_after_each_step() -> None:
    env = HouseholdEnv(split="val-unseen")
    try:
        env.reset(seed=0)
        world = env.world
        client = world.client
        for action in ("goto_kitchen", "goto_bedroom", "goto_bathroom"):
            env.step({name: env.action_names[name].index(action) for name in env.agents})
            for name, robot in world.robots.items():
                position, _ = pybullet.getBasePositionAndOrientation(world.bodies[name], physicsClientId=client)
                assert np.allclose(position[:2], robot.base_pose()[0][:2], atol=1e-4)
    finally:
        env.close()
