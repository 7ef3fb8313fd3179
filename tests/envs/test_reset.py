"""A reset moves bodies and loads none; a task is the same whatever was played before it; the start loads little."""

import subprocess
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pybullet
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.tasks.setting import DISTRACTORS, Setting
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import World, yaw_quaternion


def forbid(*_: Any, **__: Any) -> None:
    raise AssertionError("an environment that has its homes loads a body")


def play(env: HouseholdEnv, task: Task, rng: np.random.Generator, steps: int = 5) -> None:
    """Reset to a task and take some random steps."""
    env.reset(options={"task": task})
    for _ in range(steps):
        if env.agents:
            env.step({name: int(rng.integers(len(names))) for name, names in env.action_names.items()})


def test_no_body_is_loaded_after_a_home(env: HouseholdEnv, tasks: list[Task], monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(0)
    first, later = tasks[:7], tasks[7:42]
    assert len({task.home for task in first}) == 7
    for task in first:
        env.reset(options={"task": task})
    bodies = {simulation.world.client: count(simulation.world) for simulation in env._simulations._kept.values()}
    for loader in ("loadURDF", "loadSDF", "loadMJCF", "createMultiBody", "connect", "resetSimulation"):
        monkeypatch.setattr(pybullet, loader, forbid)
    for task in later:
        play(env, task, rng)
    assert bodies == {
        simulation.world.client: count(simulation.world) for simulation in env._simulations._kept.values()
    }


def count(world: World) -> int:
    return int(pybullet.getNumBodies(physicsClientId=world.client))


def layout(simulation: Simulation, setting: Setting) -> tuple[Any, ...]:
    """Return all that a task has laid out in a simulation."""
    world = simulation.world
    world.sync()
    poses = {name: (world.pose(name), world.physics.read_object(name)) for name in world.objects}
    robots = [world.physics.read_base(name) for name in world.robots]
    return setting, poses, dict(world.supports), robots, simulation.oracle.robot.arm.configuration()


def test_a_task_is_the_same_after_any_other(simulation: Simulation, tasks: list[Task]) -> None:
    own = [task for task in tasks if task.home == simulation.home.name][:6]
    before = [layout(simulation, simulation.begin(task)) for task in own]
    order = np.random.default_rng(1).permutation(len(own)).tolist()
    assert [layout(simulation, simulation.begin(own[number])) for number in order] == [
        before[number] for number in order
    ]


def test_a_task_uses_its_objects_and_parks_the_rest(simulation: Simulation, tasks: list[Task]) -> None:
    for task in [task for task in tasks if task.home == simulation.home.name][:5]:
        setting, world = simulation.begin(task), simulation.world
        assert len(world.objects) == DISTRACTORS + 1 and task.item in world.objects
        assert set(world.supports) == set(world.objects) <= set(setting.states)
        world.sync()
        heights = {name: world.physics.read_object(name)[0][2] for name in world.physics.objects}
        assert {name for name, height in heights.items() if height < 10} == set(world.objects)


def test_objects_keep_apart(simulation: Simulation, tasks: list[Task]) -> None:
    world = simulation.world
    for task in [task for task in tasks if task.home == simulation.home.name][:5]:
        simulation.begin(task)
        world.sync()
        for body in (world.bodies[name] for name in world.objects):
            for other in (world.bodies[name] for name in world.objects):
                if other > body:
                    assert not pybullet.getClosestPoints(body, other, 0.0, physicsClientId=world.client)


def exact_touch(place: np.ndarray, size: tuple[float, ...], pose: Any, other: tuple[float, ...]) -> bool:
    """Return whether an object at a place touches another, by the corners of the other in the place's own axes."""
    (x, y, z), quaternion = pose
    if place[2] > z + other[2] or place[2] + size[2] < z:
        return False
    yaw = 2 * np.arctan2(quaternion[2], quaternion[3])
    corners = np.array([(i * other[0], j * other[1]) for i in (-0.5, 0.5) for j in (-0.5, 0.5)])
    own = (corners @ turn(yaw).T + np.array([x, y]) - place[:2]) @ turn(place[3])
    low, high = own.min(axis=0), own.max(axis=0)
    half = np.array(size[:2]) / 2 + 0.01
    return bool((low <= half).all() and (high >= -half).all())


def turn(yaw: float) -> np.ndarray:
    """Return the rotation by an angle."""
    return np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])


def test_taken_is_the_touch_of_all_objects(simulation_of: Callable[[str], Simulation], tasks: list[Task]) -> None:
    """Leaving out far objects leaves out none that touches."""
    simulation, rng = simulation_of("home_7"), np.random.default_rng(2)
    world, space, found = simulation.world, simulation.space, 0
    for task in [task for task in tasks if task.home == "home_7"][:6]:
        simulation.begin(task)
        for name in world.objects:  # off the grid, where rounding decides nothing
            (x, y, z), _ = world.pose(name)
            dx, dy, yaw = rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1), rng.uniform(-np.pi, np.pi)
            world.place(name, (x + dx, y + dy, z), yaw_quaternion(yaw))
        for receptacle, item in pairs(space, rng):
            size = world.size(item)
            places = space.places(receptacle, size)
            places = places[rng.permutation(len(places))[:40]]
            expected = [
                any(exact_touch(place, size, world.pose(other), world.size(other)) for other in world.objects)
                for place in places
            ]
            assert world.taken(places, size).tolist() == expected
            found += sum(expected)
    assert found > 50


def pairs(space: Space, rng: np.random.Generator) -> list[tuple[str, str]]:
    items = ("mug_1", "board_game_1", "knife_1", "cushion_1")
    return [(receptacle, items[int(rng.integers(len(items)))]) for receptacle in space.home.receptacles]


@pytest.mark.parametrize(
    ("statement", "heavy"),
    [
        ("import chmarl_pb", ("pybullet", "scipy", "cv2", "trimesh", "yourdfpy", "pettingzoo", "torch", "matplotlib")),
        ("import chmarl_pb.homes.home as homes; homes.load_home('home_7')", ("trimesh", "yourdfpy", "torch")),
    ],
)
def test_the_start_loads_no_more_than_it_needs(statement: str, heavy: tuple[str, ...]) -> None:
    code = f"{statement}; import sys; print(*(name for name in {heavy} if name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == []
