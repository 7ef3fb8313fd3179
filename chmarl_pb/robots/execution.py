"""Carry out decided motions: set their result at once, or drive through them at 240 Hz first.

Both executions carry out the same decisions and end in the same state, bit by bit: a driven motion is a rehearsal
in physics alone, of which the state knows nothing; its result is then set as in the instant execution. This removes
the millimetres by which motors miss. If they miss by more than ``TOLERANCE``, the action fails.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.robots import trajectory
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.drone import Drone
from chmarl_pb.robots.humanoid import Humanoid
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import TIME_STEP, Grip, Pose, Vector, World, yaw_quaternion

Robots = Mapping[str, Humanoid | Drone]

TOLERANCE = 0.02  # metres between the driven gripper or object and where it was meant to be
TICKS_PER_FRAME = 8  # 30 snapshots a second
_CLEARANCE = 0.1  # metres above its target at which the hand arrives and leaves
_FOLDED: Configuration = (0.0, -0.8, 0.0, 0.0, *Arm.carry[4:])  # on the way to rest: the elbow drawn back
_HOLDING = Arm.carry[-2:]  # fingers closed on an object
_CATCH_UP_TIME, _CAUGHT_UP = 0.5, 2e-3  # seconds that joints get to come this near (rad, m) to their goal


@dataclass(frozen=True)
class Snapshot:
    """The bodies that move, at one moment.

    Attributes:
        bases: robot -> pose of its base.
        arm: configuration of the humanoid's arm.
        items: object -> its pose, for the one that moves.
    """

    bases: dict[str, Pose]
    arm: Configuration
    items: dict[str, Pose]


class MissedError(Exception):
    """A driven motion missed its target by more than ``TOLERANCE``."""


def execute(
    world: World, robots: Robots, motions: dict[str, Motion | None], simulated: bool
) -> tuple[dict[str, bool], tuple[Snapshot, ...]]:
    """Carry out one motion of each robot.

    Args:
        world: the world that they are in.
        robots: all of its robots.
        motions: robot -> its motion; None fails.
        simulated: drive through the motions at 240 Hz before setting their result.

    Returns:
        Robot -> whether its action succeeded, and snapshots of the driven motion at 30 Hz.
    """
    decided = {name: motion for name, motion in motions.items() if motion is not None}
    missed, snapshots = _rehearse(world, robots, decided) if simulated else (set(), ())
    succeeded = dict.fromkeys(motions, False)
    for name, motion in decided.items():
        succeeded[name] = name not in missed and robots[name].finish(motion)
    return succeeded, snapshots


def _rehearse(world: World, robots: Robots, motions: dict[str, Motion]) -> tuple[set[str], tuple[Snapshot, ...]]:
    """Drive all robots through their motions together, in physics alone.

    Returns:
        Names of the robots that missed, and snapshots.
    """
    item = next((motion.pick for motion in motions.values() if motion.pick), world.held)
    world.sync()
    for robot in robots.values():
        if isinstance(robot, Humanoid):
            robot.arm.drive(robot.arm.configuration())  # its motors may still have the goal of an earlier motion
    for held in world.state.held:
        world.physics.thaw(held, solid=False)
    running = {name: _ticks(robots[name], motion) for name, motion in motions.items()}
    missed: set[str] = set()
    snapshots: list[Snapshot] = []
    tick = 0
    try:
        while running:
            for name in list(running):
                if not _advance(running[name], name, missed):
                    del running[name]
            world.physics.step()
            if tick % TICKS_PER_FRAME == 0:
                snapshots.append(_snapshot(world, robots, item))
            tick += 1
    finally:
        if item is not None:
            world.physics.freeze(item)
        world.moved()
    return missed, tuple(snapshots)


def _advance(ticks: Iterator[None], name: str, missed: set[str]) -> bool:
    """Command one robot for the next step; return whether its motion goes on."""
    try:
        next(ticks)
    except StopIteration:
        return False
    except MissedError:
        missed.add(name)
        return False
    return True


def _snapshot(world: World, robots: Robots, item: str | None) -> Snapshot:
    bases = {name: world.physics.read_base(name) for name in robots}
    items = {} if item is None else {item: world.physics.read_object(item)}
    (arm,) = (robot.arm for robot in robots.values() if isinstance(robot, Humanoid))
    return Snapshot(bases, arm.configuration(), items)


# One robot's motion: generators that command it and yield once for every simulation step.


def _ticks(robot: Humanoid | Drone, motion: Motion) -> Iterator[None]:
    return _fly(robot, motion) if isinstance(robot, Drone) else _Driven(robot).act(motion)


def _fly(drone: Drone, motion: Motion) -> Iterator[None]:
    (*start, height), quaternion = drone.world.robots[drone.name].base
    for x, y in trajectory.fly(start, drone.lattice.points[motion.pose]):
        drone.world.physics.move_robot(drone.name, ((x, y, height), quaternion))
        yield


class _Driven:
    """A humanoid while physics moves it: what its gripper holds by now is not yet in the state."""

    def __init__(self, humanoid: Humanoid):
        self._humanoid, self._arm = humanoid, humanoid.arm
        self._world, self._physics, self._lattice = humanoid.world, humanoid.world.physics, humanoid.lattice
        self._grip: Grip | None = self._world.state.grips.get(humanoid.name)

    def act(self, motion: Motion) -> Iterator[None]:
        """Drive the base along the path, then pick or place; on the way to a pick the arm gets ready."""
        if motion.pick is not None:
            yield from _together(self._drive(motion), self._move_arm(Arm.carry))
            yield from self._pick(motion, motion.pick)
        else:
            yield from self._drive(motion)
            if motion.place is not None:
                yield from self._place(motion)

    def _drive(self, motion: Motion) -> Iterator[None]:
        """Drive the base; it is kinematic and takes a held object along."""
        lattice, pose = self._lattice, self._humanoid.pose
        path = lattice.path(pose // HEADINGS, motion.pose // HEADINGS)
        ends = lattice.pose(pose)[2], lattice.pose(motion.pose)[2]
        for x, y, yaw in trajectory.drive(lattice.waypoints(tuple(path)), *ends):
            self._physics.move_robot(self._humanoid.name, ((x, y, 0.0), yaw_quaternion(yaw)))
            if self._grip is not None:
                self._physics.move_object(self._grip.item, self._humanoid.held_pose(self._grip))
            yield

    def _pick(self, motion: Motion, item: str) -> Iterator[None]:
        """Reach down to an object, close the fingers on it and bring it to the carry pose."""
        name, arm = self._humanoid.name, motion.arm
        assert arm is not None
        closed = (*arm[:-2], *_HOLDING)
        for goal in (self._raised(arm), arm):
            yield from self._move_arm(goal)
        _check(self._physics.grasp_pose(name)[0], self._world.grip(item))
        yield from self._move_arm(closed)
        self._grip = Grip(item, self._humanoid.turn_of(item, motion.pose))
        self._physics.grip(name, item, self._world.pose(item))
        self._physics.thaw(item, solid=False)
        for goal in (self._raised(closed), Arm.carry):
            yield from self._move_arm(goal)

    def _place(self, motion: Motion) -> Iterator[None]:
        """Bring the held object over its place, turn it on the way, put it down and withdraw the arm."""
        arm, placement, grip = motion.arm, motion.place, self._grip
        assert arm is not None and placement is not None and grip is not None
        closed = (*arm[:-2], *_HOLDING)
        yield from self._move_arm(self._raised(closed), placement.yaw - self._lattice.pose(motion.pose)[2])
        yield from self._move_arm(closed)
        _check(self._physics.read_object(grip.item)[0], placement.position)
        self._physics.release(self._humanoid.name)
        self._physics.thaw(grip.item)
        self._grip = None
        for goal in (arm, self._raised(arm), Arm.carry, _FOLDED, Arm.rest):
            yield from self._move_arm(goal)

    def _raised(self, configuration: Configuration) -> Configuration:
        """Return the configuration with the torso higher, so that the hand comes and goes straight from above."""
        return (min(configuration[0] + _CLEARANCE, float(self._arm.upper[0])), *configuration[1:])

    def _move_arm(self, goal: Configuration, turn: float | None = None) -> Iterator[None]:
        """Drive the joints' motors to a configuration, and a held object to a yaw relative to the base."""
        arm, start = self._arm, self._grip
        for joints, speeds, share in trajectory.move_joints(arm.configuration(), goal, arm.speeds):
            arm.drive(joints, speeds)
            if start is not None and turn is not None:
                self._grip = Grip(start.item, start.turn + share * trajectory.wrap(turn - start.turn))
            self._level()
            yield
        arm.drive(goal)
        for _ in range(round(_CATCH_UP_TIME / TIME_STEP)):
            if np.abs(np.subtract(goal, arm.configuration())).max() < _CAUGHT_UP:
                return
            self._level()
            yield

    def _level(self) -> None:
        """Keep a held object upright in the gripper."""
        if self._grip is not None:
            self._physics.level(self._humanoid.name, self._humanoid.held_pose(self._grip))


def _together(*motions: Iterator[None]) -> Iterator[None]:
    """Go through several motions at once, until the last has ended."""
    return (None for _ in zip_longest(*motions))


def _check(position: Vector, goal: Vector) -> None:
    if np.linalg.norm(np.subtract(position, goal)) > TOLERANCE:
        raise MissedError
