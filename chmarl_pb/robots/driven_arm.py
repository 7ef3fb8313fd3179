"""Drive an arm through a motion in physics alone: generators that command it and yield once for a simulation step."""

from collections.abc import Callable, Iterator
from itertools import zip_longest

import numpy as np

from chmarl_pb.robots import trajectory
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import TIME_STEP, Grip, Pose, Vector, World

TOLERANCE = 0.02  # metres between the driven gripper or object and where it was meant to be

_CLEARANCE = 0.1  # metres above its target at which the hand arrives and leaves
_FOLDED: Configuration = (0.0, -0.8, 0.0, 0.0, *Arm.carry[4:])  # on the way to rest: the elbow drawn back
_HOLDING = Arm.carry[-2:]  # fingers closed on an object
_CATCH_UP_TIME, _CAUGHT_UP = 0.5, 2e-3  # seconds that joints get to come this near (rad, m) to their goal


class MissedError(Exception):
    """A driven motion missed its target by more than ``TOLERANCE``."""


class DrivenArm:
    """A robot with an arm while physics moves it: what its gripper holds by now is not yet in the state."""

    def __init__(self, name: str, arm: Arm, world: World, held_pose: Callable[[Grip], Pose]):
        """Drive a robot's arm.

        Args:
            name: of the robot.
            arm: its arm.
            world: the world that it is in.
            held_pose: the pose in physics of an object in its gripper.
        """
        self._name, self._arm, self._world, self._physics = name, arm, world, world.physics
        self._held_pose = held_pose
        self._grip: Grip | None = world.state.grips.get(name)

    def act(self, motion: Motion, way: Iterator[Pose], heading: float, turn: float) -> Iterator[None]:
        """Drive the base along its way, then pick or place; on the way to a pick the arm gets ready.

        Args:
            motion: what is to be done.
            way: where the base is at every simulation step.
            heading: of the base at its end, radians.
            turn: yaw relative to the base of the object to be picked, radians.
        """
        if motion.pick is not None:
            yield from _together(self._drive(way), self._move_arm(Arm.carry))
            yield from self._pick(motion, Grip(motion.pick, turn))
        else:
            yield from self._drive(way)
            if motion.place is not None:
                yield from self._place(motion, heading)

    def _drive(self, way: Iterator[Pose]) -> Iterator[None]:
        """Drive the base; it is kinematic and takes a held object along."""
        for base in way:
            self._physics.move_robot(self._name, base)
            if self._grip is not None:
                self._physics.move_object(self._grip.item, self._held_pose(self._grip))
            yield

    def _pick(self, motion: Motion, grip: Grip) -> Iterator[None]:
        """Reach down to an object, close the fingers on it and bring it to the carry pose."""
        arm, item = motion.arm, grip.item
        assert arm is not None
        closed = (*arm[:-2], *_HOLDING)
        for goal in (self._raised(arm), arm):
            yield from self._move_arm(goal)
        _check(self._physics.grasp_pose(self._name)[0], self._world.grip(item))
        yield from self._move_arm(closed)
        self._grip = grip
        self._physics.grip(self._name, item, self._world.pose(item))
        self._physics.thaw(item, solid=False)
        for goal in (self._raised(closed), Arm.carry):
            yield from self._move_arm(goal)

    def _place(self, motion: Motion, heading: float) -> Iterator[None]:
        """Bring the held object over its place, turn it on the way, put it down and withdraw the arm."""
        arm, placement, grip = motion.arm, motion.place, self._grip
        assert arm is not None and placement is not None and grip is not None
        closed = (*arm[:-2], *_HOLDING)
        yield from self._move_arm(self._raised(closed), placement.yaw - heading)
        yield from self._move_arm(closed)
        _check(self._physics.read_object(grip.item)[0], placement.position)
        self._physics.release(self._name)
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
            self._physics.level(self._name, self._held_pose(self._grip))


def _together(*motions: Iterator[None]) -> Iterator[None]:
    """Go through several motions at once, until the last has ended."""
    return (None for _ in zip_longest(*motions))


def _check(position: Vector, goal: Vector) -> None:
    if np.linalg.norm(np.subtract(position, goal)) > TOLERANCE:
        raise MissedError
