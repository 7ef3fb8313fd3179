"""Both executions of an action: the same end bit by bit, exact grips, smooth and free ways."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pybullet
import pytest

from chmarl_pb import catalog
from chmarl_pb.homes.home import home_names, load_home
from chmarl_pb.homes.solids import segments_hit
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.navigation.lattice import FOOTPRINT
from chmarl_pb.robots import driven_arm, trajectory
from chmarl_pb.robots.arm import Arm
from chmarl_pb.robots.execution import TICKS_PER_FRAME, Snapshot, execute
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.mobile import MobileRobot
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.robots.robot import Robot
from chmarl_pb.tasks.arrangement import Arrangement
from chmarl_pb.world import TIME_STEP, Grip, World

FRAME = TICKS_PER_FRAME * TIME_STEP


class Simulation:
    """A world with both robots, and one object on a receptacle."""

    def __init__(self, home: str):
        self.space = space_of(load_home(home))
        self.world = World(self.space.home)
        models = team_of(TEAM)
        self.humanoid = MobileManipulator(models["humanoid"], self.world, self.space, "humanoid")
        self.drone = MobileRobot(models["drone"], self.world, self.space, "drone")
        self.robots: dict[str, Robot] = {"humanoid": self.humanoid, "drone": self.drone}
        self.goal = Goal("", ())

    def set_up(self, seed: int) -> None:
        """Lay out an object, a target and the robots, drawn from a seed."""
        rng = np.random.default_rng(seed)
        receptacles = rng.permutation(list(self.space.home.receptacles)).tolist()
        item = f"{rng.choice(list(catalog.BENCHMARK.graspables))}_1"
        carriers = [name for name in receptacles if Arrangement(self.world, self.space, rng).put(item, name)]
        laid = Arrangement(self.world, self.space, rng)
        laid.put(item, carriers[0])
        laid.put("lime_1" if item != "lime_1" else "peach_1", carriers[1])
        self.world.arrange(laid.objects)
        self.goal = Goal(item, (carriers[-1],))
        self.humanoid.spawn(int(rng.integers(12 * len(self.space.lattice.points))))
        self.drone.spawn(int(rng.integers(len(self.space.drone_lattice.points))))

    def act(self, action: str, simulated: bool, drone: str = "stay") -> tuple[bool, tuple[Snapshot, ...]]:
        """Let the humanoid carry out an action that sees everything."""
        motion = self.humanoid.plan(action, self.goal, (self.goal.item, *self.goal.receptacles))
        assert motion is not None
        motions = {"humanoid": motion, "drone": self.drone.plan(drone)}
        done, snapshots = execute(self.world, self.robots, motions, simulated)
        return done["humanoid"], snapshots

    def state(self) -> dict[str, Any]:
        """Return all that an action can change, exactly."""
        world, physics = self.world, self.world.physics
        world.sync()
        return {
            "state": world.state,
            "poses": {name: physics.read_object(name) for name in world.objects},
            "bases": {name: physics.read_base(name) for name in world.robots},
            "arm": self.humanoid.arm.configuration(),
            "bodies": dict(world.bodies),
        }


@pytest.fixture(scope="module")
def simulations() -> Iterator[dict[str, Simulation]]:
    simulations: dict[str, Simulation] = {}
    yield simulations
    for simulation in simulations.values():
        simulation.world.close()


def simulation_of(simulations: dict[str, Simulation], home: str) -> Simulation:
    if home not in simulations:
        simulations[home] = Simulation(home)
    return simulations[home]


@pytest.fixture
def simulation(simulations: dict[str, Simulation]) -> Simulation:
    return simulation_of(simulations, "home_1")


@pytest.fixture
def misses(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """Distances in metres between what was driven and where it was meant to be, one a grip or release."""
    distances: list[float] = []
    check = driven_arm._check

    def record(position: Any, goal: Any) -> None:
        distances.append(float(np.linalg.norm(np.subtract(position, goal))))
        check(position, goal)

    monkeypatch.setattr(driven_arm, "_check", record)
    return distances


@pytest.mark.parametrize(
    "home",
    [pytest.param(home, marks=[pytest.mark.slow] * (home not in ("home_1", "home_6"))) for home in home_names()],
)
@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_both_executions_end_the_same(
    simulations: dict[str, Simulation], misses: list[float], home: str, seed: int
) -> None:
    simulation, ends = simulation_of(simulations, home), []
    for simulated in (True, False):
        simulation.set_up(seed)
        end = []
        for action, drone in (("pick", "goto_kitchen"), ("place", "goto_bedroom"), ("pick", "stay")):
            end.append((simulation.act(action, simulated, drone)[0], simulation.state()))
        ends.append(end)
    assert ends[0] == ends[1]
    assert ends[0][0][0], "every object that lies within reach can be picked"
    assert len(misses) >= 2 and max(misses) < 0.01


@pytest.mark.parametrize(
    "home",
    [pytest.param(home, marks=[pytest.mark.slow] * (number % 3 > 0)) for number, home in enumerate(home_names())],
)
def test_the_base_keeps_clear_and_moves_smoothly(simulations: dict[str, Simulation], home: str) -> None:
    simulation = simulation_of(simulations, home)
    simulation.set_up(3)
    for action in ("goto_kitchen", "goto_bedroom", "pick", "turn_left"):
        start = simulation.humanoid.pose
        done, snapshots = simulation.act(action, simulated=True)
        assert done
        bases = [snapshot.bases["humanoid"] for snapshot in snapshots]
        points = np.array([position[:2] for position, _ in bases])
        for solid in simulation.space.lattice.obstacles:
            assert not segments_hit(solid.polygon, points, points, FOOTPRINT.radius - 1e-3).any()
        yaws = np.unwrap([2 * np.arctan2(quaternion[2], quaternion[3]) for _, quaternion in bases])
        assert np.abs(np.diff(points, n=2, axis=0)).max() < 4.0 * FRAME**2
        assert np.abs(np.diff(yaws, n=2)).max() < 10.0 * FRAME**2
        assert np.hypot(*(points[0] - simulation.space.lattice.pose(start)[:2])) < 0.01


def test_the_held_object_stays_in_the_hand(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    humanoid, world, gaps, tilts, heights = simulation.humanoid, simulation.world, [], [], []
    physics, step = world.physics, world.physics.step

    def watch() -> None:
        step()
        if pybullet.getNumConstraints(physicsClientId=world.client):  # the state does not know of a rehearsed grip
            position, quaternion = physics.read_object(simulation.goal.item)
            gaps.append(np.linalg.norm(np.subtract(position, humanoid.held_pose(Grip(simulation.goal.item, 0.0))[0])))
            tilts.append(np.hypot(quaternion[0], quaternion[1]))
            heights.append(position[2])

    monkeypatch.setattr(physics, "step", watch)
    for seed in (4, 5):
        simulation.set_up(seed)
        for action in ("pick", "goto_bathroom", "place"):
            for figures in (gaps, tilts, heights):
                figures.clear()
            assert simulation.act(action, simulated=True)[0]
            assert gaps or action.startswith("goto_"), "only a drive with a still arm is not simulated"
            assert max(gaps, default=0.0) < 0.01
            assert max(tilts, default=0.0) < 0.05
            assert np.abs(np.diff(heights, n=2)).max(initial=0.0) < 1e-3


def test_the_arm_moves_at_a_human_pace(simulation: Simulation) -> None:
    for seed in range(7, 11):
        simulation.set_up(seed)
        motion = simulation.humanoid.plan("pick", simulation.goal, (simulation.goal.item,))
        assert motion is not None
        simulation.humanoid.spawn(motion.pose)
        done, snapshots = simulation.act("pick", simulated=True)
        assert done
        assert 2.0 < len(snapshots) * FRAME < 10.0  # slower where there is little room
        joints = np.array([snapshot.joints["humanoid"] for snapshot in snapshots])
        assert np.abs(np.diff(joints, axis=0)).max() < 2.6 * FRAME
        assert (joints >= simulation.humanoid.arm.lower - 0.01).all() and (
            joints <= simulation.humanoid.arm.upper + 0.01
        ).all()


@pytest.mark.parametrize("action", ["pick", "place"])
def test_a_miss_leaves_the_world_as_it_was(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch, action: str
) -> None:
    simulation.set_up(8)
    if action == "place":
        assert simulation.act("pick", simulated=True)[0]
    before = simulation.state()
    monkeypatch.setattr(driven_arm, "TOLERANCE", 0.0)
    assert not simulation.act(action, simulated=True)[0]
    assert simulation.state() == before
    monkeypatch.undo()
    assert simulation.act(action, simulated=True)[0]


@pytest.mark.parametrize("simulated", [False, True])
def test_an_object_that_does_not_settle_stays_in_the_hand(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch, simulated: bool
) -> None:
    simulation.set_up(9)
    assert simulation.act("pick", simulated)[0]
    before = simulation.state()
    monkeypatch.setattr(simulation.world.physics, "rests_on", lambda *_: False)
    assert not simulation.act("place", simulated)[0]
    assert simulation.state() == before


def test_an_undecided_motion_fails_and_the_other_robot_still_acts(simulation: Simulation) -> None:
    simulation.set_up(10)
    simulation.drone.spawn(0)
    before = simulation.humanoid.pose
    far = max(
        simulation.space.drone_lattice.anchors, key=lambda room: abs(simulation.space.drone_lattice.anchors[room])
    )
    goal = simulation.drone.plan(f"goto_{far}")
    assert goal is not None
    simulation.humanoid.arm.drive(Arm.carry)
    done, snapshots = execute(simulation.world, simulation.robots, {"humanoid": None, "drone": goal}, simulated=True)
    assert done == {"humanoid": False, "drone": True}
    assert simulation.humanoid.pose == before and simulation.drone.pose == goal.pose
    simulation.world.sync()
    assert len(snapshots) > 10 and simulation.humanoid.arm.configuration() == Arm.rest
    assert np.abs(np.subtract([snapshot.joints["humanoid"] for snapshot in snapshots], Arm.rest)).max() < 0.01


def test_profiles_start_and_stop_gently_at_their_speed() -> None:
    for distance in (0.01, 0.25, 1.0, 7.0):
        shares = trajectory.profile(distance, 1.2, 1.5)
        speeds = np.diff(shares, prepend=0.0) * distance / TIME_STEP
        assert shares[-1] == 1.0
        assert (speeds > 0).all() and speeds.max() < 1.2 * 1.01
        assert max(speeds[0], speeds[-1]) < 0.02
        assert np.allclose(speeds, speeds[::-1])
    assert len(trajectory.profile(0.0, 1.2, 1.5)) == 0
