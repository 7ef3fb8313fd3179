"""Carry out decided motions: set their result at once, or drive through them at 240 Hz first.

Both executions carry out the same decisions and end in the same state: a simulated motion is
followed by the same ``finish`` as an instant one, which removes the millimetres by which motors miss.
If they miss by more than ``TOLERANCE``, the action fails.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.robots.arm import OPEN, Arm, Configuration
from chmarl_pb.robots.drone import Drone
from chmarl_pb.robots.humanoid import Humanoid
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import TIME_STEP, Pose, World, yaw_quaternion

TOLERANCE = 0.03  # metres between the driven gripper or object and where it was meant to be
TICKS_PER_FRAME = 8  # 30 snapshots a second
_DRIVE_SPEED, _TURN_SPEED, _FLY_SPEED, _JOINT_SPEED = 1.1, 2.2, 2.0, 1.4  # m/s and rad/s, peaks of smooth profiles
_GRIP_TIME = 0.25  # seconds to open or close the fingers
_CATCH_UP_TIME, _CAUGHT_UP = 1.0, 5e-3  # seconds that motors get to come this near (rad) to their goal
_ALIGNED = 0.12  # radians: a base this near to its way need not turn first


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
    before = world.held
    missed: set[str] = set()
    snapshots = _simulate(world, decided, missed) if simulated else ()
    succeeded = {name: name in decided and name not in missed for name in motions}
    for name, motion in decided.items():
        robot = world.robots[name]
        if name in missed:
            _undo(robot, before)
        else:
            succeeded[name] = robot.finish(motion)
    return succeeded, snapshots


def _undo(humanoid: Humanoid, held: str | None) -> None:
    """Put the humanoid back to where it stood before a motion that missed."""
    humanoid.spawn(humanoid.pose)
    if held is not None:
        humanoid.hold(held)


def _simulate(world: World, motions: dict[str, Motion], missed: set[str]) -> tuple[Snapshot, ...]:
    """Drive all robots through their motions together; names of those that miss are added to ``missed``.

    Afterwards the object that moved is where it was before: finishing the motion puts it where it belongs.
    """
    humanoid, held = world.robots["humanoid"], world.held
    turn = humanoid.turn
    moving = next((name for motion in motions.values() if (name := motion.pick)), held)
    if moving is not None:
        pose, support = world.pose(moving), world.supports.get(moving)
        world.collide(moving, on=False)
    if held is not None:
        world.thaw(held)
    snapshots = _run(world, motions, moving, missed)
    humanoid.turn = turn
    if moving is not None:
        world.release()
        world.freeze(moving)
        world.collide(moving, on=True)
        world.place(moving, *pose, receptacle=support.receptacle if support else None)
    if held is not None:
        humanoid.hold(held)
    return snapshots


def _run(world: World, motions: dict[str, Motion], moving: str | None, missed: set[str]) -> tuple[Snapshot, ...]:
    """Step physics until every robot has ended its motion."""
    running = {name: _ticks(world.robots[name], motion) for name, motion in motions.items()}
    snapshots: list[Snapshot] = []
    tick = 0
    while running:
        for name, ticks in list(running.items()):
            try:
                if next(ticks, None) is None:
                    del running[name]
            except MissedError:
                missed.add(name)
                del running[name]
        world.step()
        if tick % TICKS_PER_FRAME == 0:
            snapshots.append(_snapshot(world, moving))
        tick += 1
    return tuple(snapshots)


def _snapshot(world: World, moving: str | None) -> Snapshot:
    bases = {name: robot.read_base() for name, robot in world.robots.items()}
    items = {} if moving is None else {moving: world.read_pose(moving)}
    return Snapshot(bases, world.robots["humanoid"].arm.configuration(), items)


def _ticks(robot: Humanoid | Drone, motion: Motion) -> Iterator[bool]:
    """Yield once for every simulation step of a robot's motion."""
    return _fly(robot, motion) if isinstance(robot, Drone) else _act(robot, motion)


def _fly(drone: Drone, motion: Motion) -> Iterator[bool]:
    (x, y, z), quaternion = drone.base_pose()
    goal = drone.lattice.points[motion.pose]
    for share in _smooth(float(np.hypot(goal[0] - x, goal[1] - y)) / _FLY_SPEED):
        drone.set_base((x + share * (goal[0] - x), y + share * (goal[1] - y), z), quaternion)
        yield True


def _act(humanoid: Humanoid, motion: Motion) -> Iterator[bool]:
    """Drive the base along the path, then move the arm: pick or place."""
    resting: Configuration = Arm.carry if humanoid.world.held else Arm.rest
    for x, y, yaw in _drive(humanoid, motion):
        humanoid.set_base((x, y, 0.0), yaw_quaternion(yaw))
        _hold_still(humanoid, resting, humanoid.turn)
        yield True
    if motion.pick is not None:
        yield from _pick(humanoid, motion, motion.pick)
    elif motion.place is not None:
        yield from _place(humanoid, motion)


def _drive(humanoid: Humanoid, motion: Motion) -> Iterator[tuple[float, float, float]]:
    """Yield the base's x, y and yaw at every step: turn to each straight piece, drive it, turn to the end."""
    x, y, yaw = humanoid.lattice.pose(humanoid.pose)
    _, _, final = humanoid.lattice.pose(motion.pose)
    for goal_x, goal_y in humanoid.lattice.waypoints(motion.path)[1:].tolist():
        ahead = float(np.arctan2(goal_y - y, goal_x - x))
        if abs(_wrap(ahead - yaw)) > _ALIGNED:
            yield from ((x, y, angle) for angle in _turn(yaw, ahead))
            yaw = ahead
        for share in _smooth(float(np.hypot(goal_x - x, goal_y - y)) / _DRIVE_SPEED):
            yield x + share * (goal_x - x), y + share * (goal_y - y), yaw
        x, y = goal_x, goal_y
    yield from ((x, y, angle) for angle in _turn(yaw, final))


def _pick(humanoid: Humanoid, motion: Motion, item: str) -> Iterator[bool]:
    world, arm = humanoid.world, motion.arm
    assert arm is not None
    yield from _move_arm(humanoid, arm, 0.0)
    if np.linalg.norm(np.subtract(humanoid.arm.grasp_pose()[0], world.grip(item))) > TOLERANCE:
        raise MissedError
    humanoid.turn = humanoid.turn_of(item, motion.pose)
    closed = (*arm[:-2], *Arm.carry[-2:])
    yield from _move_arm(humanoid, closed, humanoid.turn, _GRIP_TIME)
    world.attach(item, humanoid.body, humanoid.arm.grasp_link, humanoid.arm.grasp_pose())
    world.thaw(item)
    yield from _move_arm(humanoid, Arm.carry, humanoid.turn)


def _place(humanoid: Humanoid, motion: Motion) -> Iterator[bool]:
    world, arm, placement, item = humanoid.world, motion.arm, motion.place, humanoid.world.held
    assert arm is not None and placement is not None and item is not None
    closed = (*arm[:-2], *Arm.carry[-2:])
    turn = _wrap(placement.yaw - humanoid.lattice.pose(motion.pose)[2])
    yield from _move_arm(humanoid, closed, turn)
    if np.linalg.norm(np.subtract(world.read_pose(item)[0], placement.position)) > TOLERANCE:
        raise MissedError
    world.release()
    world.collide(item, on=True)
    yield from _move_arm(humanoid, (*arm[:-2], OPEN, OPEN), turn, _GRIP_TIME)
    yield from _move_arm(humanoid, Arm.rest, turn)


def _move_arm(humanoid: Humanoid, goal: Configuration, turn: float, least: float = 0.3) -> Iterator[bool]:
    """Drive the joints' motors to a configuration, and the held object to a yaw relative to the base."""
    start, start_turn = humanoid.arm.configuration(), humanoid.turn
    change = np.subtract(goal, start)
    for share in _smooth(max(float(np.abs(change).max()) / _JOINT_SPEED, least)):
        configuration = tuple((np.array(start) + share * change).tolist())
        _hold_still(humanoid, configuration, start_turn + share * _wrap(turn - start_turn))
        yield True
    for _ in range(round(_CATCH_UP_TIME / TIME_STEP)):
        if np.abs(np.subtract(goal, humanoid.arm.configuration())).max() < _CAUGHT_UP:
            return
        _hold_still(humanoid, goal, turn)
        yield True


def _hold_still(humanoid: Humanoid, configuration: Configuration, turn: float) -> None:
    """Command the motors, and keep a held object level."""
    humanoid.arm.drive(configuration)
    held = humanoid.world.held
    if held is not None:
        humanoid.turn = turn
        humanoid.world.level(humanoid.arm.grasp_pose(), humanoid.held_pose(held))


def _turn(start: float, goal: float) -> Iterator[float]:
    change = _wrap(goal - start)
    return (start + share * change for share in _smooth(abs(change) / _TURN_SPEED))


def _smooth(seconds: float) -> NDArray[np.float64]:
    """Return shares from 0 to 1, one a simulation step, that start and stop gently; none for no time."""
    if seconds < TIME_STEP:
        return np.zeros(0)
    time = np.linspace(0, 1, round(1.4 * seconds / TIME_STEP) + 1)[1:]
    return time**3 * (10 + time * (6 * time - 15))


def _wrap(angle: float) -> float:
    return float((angle + np.pi) % (2 * np.pi) - np.pi)
