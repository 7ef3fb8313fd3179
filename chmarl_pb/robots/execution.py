"""Carry out decided motions: set their result at once, or drive through them at 240 Hz first.

Both executions carry out the same decisions and end in the same state, bit by bit: a driven motion is a rehearsal
after which the world is put back, and then its result is set as in the instant execution. This removes the
millimetres by which motors miss. If they miss by more than ``TOLERANCE``, the action fails.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from itertools import zip_longest

import numpy as np

from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.robots import trajectory
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.drone import Drone
from chmarl_pb.robots.humanoid import Humanoid
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import TIME_STEP, Pose, Vector, World, yaw_quaternion

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
    world: World, motions: dict[str, Motion | None], simulated: bool
) -> tuple[dict[str, bool], tuple[Snapshot, ...]]:
    """Carry out one motion of each robot.

    Args:
        world: the world with its robots.
        motions: robot -> its motion; None fails.
        simulated: drive through the motions at 240 Hz before setting their result.

    Returns:
        Robot -> whether its action succeeded, and snapshots of the driven motion at 30 Hz.
    """
    decided = {name: motion for name, motion in motions.items() if motion is not None}
    missed, snapshots = _rehearse(world, decided) if simulated else (set(), ())
    succeeded = dict.fromkeys(motions, False)
    for name, motion in decided.items():
        succeeded[name] = name not in missed and world.robots[name].finish(motion)
    return succeeded, snapshots


def _rehearse(world: World, motions: dict[str, Motion]) -> tuple[set[str], tuple[Snapshot, ...]]:
    """Drive all robots through their motions together, then put the world back.

    Returns:
        Names of the robots that missed, and snapshots.
    """
    item = next((motion.pick for motion in motions.values() if motion.pick), world.held)
    running = {name: _ticks(world.robots[name], motion) for name, motion in motions.items()}
    missed: set[str] = set()
    snapshots: list[Snapshot] = []
    tick = 0
    with _putting_back(world, item):
        while running:
            for name in list(running):
                if not _advance(running[name], name, missed):
                    del running[name]
            world.step()
            if tick % TICKS_PER_FRAME == 0:
                snapshots.append(_snapshot(world, item))
            tick += 1
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


@contextmanager
def _putting_back(world: World, item: str | None) -> Iterator[None]:
    """Get ready to step physics; afterwards the robots and the one object that it may have moved are put back."""
    humanoid, held, supports = world.robots["humanoid"], world.held, dict(world.supports)
    turn = humanoid.turn
    pose = world.pose(item) if item else None
    humanoid.arm.drive(humanoid.arm.configuration())  # its motors may still have the goal of an earlier motion
    if held is not None:
        world.thaw(held, solid=False)
    try:
        yield
    finally:
        world.release()
        if item is not None and pose is not None:
            world.freeze(item)
            world.place(item, *pose)
            world.supports = supports
        humanoid.turn = turn
        for robot in world.robots.values():
            robot.spawn(robot.pose)
        if held is not None:
            humanoid.hold(held)


def _snapshot(world: World, item: str | None) -> Snapshot:
    bases = {name: robot.read_base() for name, robot in world.robots.items()}
    items = {} if item is None else {item: world.read_pose(item)}
    return Snapshot(bases, world.robots["humanoid"].arm.configuration(), items)


# One robot's motion: generators that command it and yield once for every simulation step.


def _ticks(robot: Humanoid | Drone, motion: Motion) -> Iterator[None]:
    return _fly(robot, motion) if isinstance(robot, Drone) else _act(robot, motion)


def _fly(drone: Drone, motion: Motion) -> Iterator[None]:
    start, quaternion = drone.base_pose()
    for x, y in trajectory.fly(start[:2], drone.lattice.points[motion.pose]):
        drone.set_base((x, y, start[2]), quaternion)
        yield


def _act(humanoid: Humanoid, motion: Motion) -> Iterator[None]:
    """Drive the base along the path, then pick or place; on the way to a pick the arm gets ready."""
    if motion.pick is not None:
        yield from _together(_drive(humanoid, motion), _move_arm(humanoid, Arm.carry))
        yield from _pick(humanoid, motion, motion.pick)
    else:
        yield from _drive(humanoid, motion)
        if motion.place is not None:
            yield from _place(humanoid, motion)


def _together(*motions: Iterator[None]) -> Iterator[None]:
    """Go through several motions at once, until the last has ended."""
    return (None for _ in zip_longest(*motions))


def _drive(humanoid: Humanoid, motion: Motion) -> Iterator[None]:
    """Drive the base; it is kinematic and takes a held object along."""
    world, lattice = humanoid.world, humanoid.lattice
    start, end = lattice.pose(humanoid.pose)[2], lattice.pose(motion.pose)[2]
    path = lattice.path(humanoid.pose // HEADINGS, motion.pose // HEADINGS)
    for x, y, yaw in trajectory.drive(lattice.waypoints(tuple(path)), start, end):
        humanoid.set_base((x, y, 0.0), yaw_quaternion(yaw))
        if world.held is not None:
            world.place(world.held, *humanoid.held_pose(world.held))
        yield


def _pick(humanoid: Humanoid, motion: Motion, item: str) -> Iterator[None]:
    """Reach down to an object, close the fingers on it and bring it to the carry pose."""
    world, arm = humanoid.world, motion.arm
    assert arm is not None
    closed = (*arm[:-2], *_HOLDING)
    for goal in (_raised(humanoid, arm), arm):
        yield from _move_arm(humanoid, goal)
    _check(humanoid.grasp_pose()[0], world.grip(item))
    yield from _move_arm(humanoid, closed)
    humanoid.turn = humanoid.turn_of(item, motion.pose)
    world.attach(item, humanoid.body, humanoid.arm.grasp_link, humanoid.grasp_pose())
    world.thaw(item, solid=False)
    for goal in (_raised(humanoid, closed), Arm.carry):
        yield from _move_arm(humanoid, goal)


def _place(humanoid: Humanoid, motion: Motion) -> Iterator[None]:
    """Bring the held object over its place, turn it on the way, put it down and withdraw the arm."""
    world, arm, placement, item = humanoid.world, motion.arm, motion.place, humanoid.world.held
    assert arm is not None and placement is not None and item is not None
    closed = (*arm[:-2], *_HOLDING)
    turn = placement.yaw - humanoid.lattice.pose(motion.pose)[2]
    yield from _move_arm(humanoid, _raised(humanoid, closed), turn)
    yield from _move_arm(humanoid, closed)
    _check(world.read_pose(item)[0], placement.position)
    world.release()
    world.thaw(item)
    for goal in (arm, _raised(humanoid, arm), Arm.carry, _FOLDED, Arm.rest):
        yield from _move_arm(humanoid, goal)


def _raised(humanoid: Humanoid, configuration: Configuration) -> Configuration:
    """Return the configuration with the torso higher, so that the hand comes and goes straight from above."""
    return (min(configuration[0] + _CLEARANCE, float(humanoid.arm.upper[0])), *configuration[1:])


def _check(position: Vector, goal: Vector) -> None:
    if np.linalg.norm(np.subtract(position, goal)) > TOLERANCE:
        raise MissedError


def _move_arm(humanoid: Humanoid, goal: Configuration, turn: float | None = None) -> Iterator[None]:
    """Drive the joints' motors to a configuration, and a held object to a yaw relative to the base."""
    arm, start_turn = humanoid.arm, humanoid.turn
    change = 0.0 if turn is None else trajectory.wrap(turn - start_turn)
    for joints, speeds, share in trajectory.move_joints(arm.configuration(), goal, arm.speeds):
        arm.drive(joints, speeds)
        humanoid.turn = start_turn + share * change
        _level(humanoid)
        yield
    arm.drive(goal)
    for _ in range(round(_CATCH_UP_TIME / TIME_STEP)):
        if np.abs(np.subtract(goal, arm.configuration())).max() < _CAUGHT_UP:
            return
        _level(humanoid)
        yield


def _level(humanoid: Humanoid) -> None:
    """Keep a held object upright in the gripper."""
    held = humanoid.world.held
    if held is not None:
        humanoid.world.level(humanoid.grasp_pose(), humanoid.held_pose(held))
