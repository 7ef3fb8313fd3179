"""Drive an arm through a motion in physics alone: generators that command it and yield once for a simulation step."""

from collections.abc import Callable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.navigation.free_space import Size, grip_point
from chmarl_pb.robots import trajectory
from chmarl_pb.robots.motion import Motion, Tick
from chmarl_pb.robots.own_arm import AnyArm
from chmarl_pb.robots.planning import ALLOWED, Depths, Path, as_posture, find_path, find_start, search
from chmarl_pb.robots.reaching import Reach, choose_reach
from chmarl_pb.robots.surroundings import Surroundings, Touching
from chmarl_pb.robots.travel import choose_postures
from chmarl_pb.world import TIME_STEP, Grip, Pose, Vector, World, yaw_quaternion

Array = NDArray[np.float64]

TOLERANCE = 0.02  # metres between the driven gripper or object and where it was meant to be

_CLEARANCE = 0.1  # metres above its target at which the hand arrives and leaves
_WITH_LOAD = 0.6  # of the joints' highest speeds: what is held lags behind a faster hand by more than a centimetre
_CAREFUL = 0.5  # of these speeds where there is little room: motors lag and what is held tilts by millimetres
_BY_MOTORS, _CARRIED = Tick(), Tick(by_motors=False)
_CATCH_UP_TIME, _CAUGHT_UP = 0.5, 2e-3  # seconds that joints get to come this near (rad, m) to their goal


class MissedError(Exception):
    """A driven motion missed its target by more than ``TOLERANCE``."""


class DrivenArm:
    """A robot with an arm while physics moves it: what its gripper holds by now is not yet in the state."""

    def __init__(
        self, name: str, arm: AnyArm, world: World, held_pose: Callable[[Grip], Pose], surroundings: Surroundings
    ):
        """Drive a robot's arm.

        Args:
            name: of the robot.
            arm: its arm.
            world: the world that it is in.
            held_pose: the pose in physics of an object in its gripper.
            surroundings: what it shall not touch.
        """
        self._name, self._arm, self._world, self._physics = name, arm, world, world.physics
        self._held_pose, self._surroundings = held_pose, surroundings
        self._grip: Grip | None = world.state.grips.get(name)
        self._posture = as_posture(arm.configuration(), 0.0 if self._grip is None else self._grip.turn)

    @property
    def held(self) -> str | None:
        """Name of the object in its gripper by now, or None."""
        return None if self._grip is None else self._grip.item

    def act(self, motion: Motion, legs: Sequence[Array], end: Array, turn: float) -> Iterator[Tick]:
        """Drive the base along its way, then pick or place.

        Args:
            motion: what is to be done.
            legs: (n, 3) x, y and yaw of the base at every simulation step; it stands still between two legs.
            end: (3,) where the base is at the end.
            turn: yaw relative to the base of the object to be picked, radians.
        """
        if motion.arm is None:
            yield from self._drive(legs, end, self._free(end, self._grip)) if legs else ()
        elif motion.pick is not None:
            grip = Grip(motion.pick, turn)
            level = self._world.pose(motion.pick)[0][2]
            reach = self._choose_reach(motion, self._world.grip(motion.pick), level, end, (self._grip, grip))
            yield from self._drive(legs, end, [reach.start])
            yield from self._pick(grip, reach)
        else:
            assert motion.place is not None and self._grip is not None
            item, put = self._grip.item, motion.place
            turn = self._grip.turn + trajectory.wrap(put.yaw - float(end[2]) - self._grip.turn)
            x, y, z = put.position
            point = grip_point((x, y, z), self._world.size(item))
            reach = self._choose_reach(motion, point, z, end, (Grip(item, turn), None))
            yield from self._drive(legs, end, [reach.start])
            yield from self._place(put.position, reach)

    def _drive(self, legs: Sequence[Array], end: Array, ends: Sequence[int]) -> Iterator[Tick]:
        """Drive the base; it is kinematic and takes a held object along.

        Args:
            legs: of the base.
            end: where it is at the end.
            ends: numbers of the postures that the arm may have there.
        """
        legs = [*legs, end[None]]
        grip, options = self._grip, self._options(self._grip)
        free = self._free(legs[0][0], grip)
        around, load = self._surroundings, self._size(grip)
        start, ways = choose_postures(
            legs,
            free,
            ends,
            options,
            lambda postures, bases, margin: around.depths(postures, bases, Touching(load, margin)),
            partial(self._change, grip),
            self._limits(options),
        )
        self._jump(options[start])
        for leg, way in zip(legs, ways, strict=True):
            yield from self._follow(way.path)
            for x, y, yaw in leg.tolist():
                self._physics.move_robot(self._name, ((x, y, 0.0), yaw_quaternion(yaw)))
                if self._grip is not None:
                    self._physics.move_object(self._grip.item, self._held_pose(self._grip))
                yield _CARRIED

    def _pick(self, grip: Grip, reach: Reach) -> Iterator[Tick]:
        """Reach down to an object, close the fingers on it and bring it to where it is carried."""
        yield from self._follow(reach.there)
        yield from self._move_arm(reach.target, True)
        _check(self._physics.grasp_pose(self._name)[0], self._world.grip(grip.item))
        yield from self._move_arm(self._closed(reach.target), True)
        self._grip = grip
        self._physics.grip(self._name, grip.item, self._world.pose(grip.item))
        self._physics.thaw(grip.item, solid=False)
        yield from self._move_arm(self._closed(reach.above), True)
        yield from self._follow(reach.back)

    def _place(self, position: Vector, reach: Reach) -> Iterator[Tick]:
        """Bring the held object over its place, turn it on the way, put it down and withdraw the arm."""
        grip = self._grip
        assert grip is not None
        yield from self._follow(reach.there)
        yield from self._move_arm(self._closed(reach.target), True)
        _check(self._physics.read_object(grip.item)[0], position)
        self._physics.release(self._name)
        self._physics.thaw(grip.item)
        self._grip = None
        yield from self._move_arm(reach.target, True)
        yield from self._move_arm(reach.above, True)
        yield from self._follow(reach.back)

    # Planning

    def _size(self, grip: Grip | None) -> Size | None:
        return None if grip is None else self._world.size(grip.item)

    def _free(self, base: Array, grip: Grip | None) -> list[int]:
        """Return the numbers of the postures that are free where the base stands; that of the least deep if none is."""
        depths = self._surroundings.depths(self._options(grip), base, Touching(self._size(grip)))
        return np.flatnonzero(depths <= ALLOWED).tolist() or [int(depths.argmin())]

    def _depths(self, base: Array, grip: Grip | None, level: float | None = None) -> Depths:
        load = self._size(grip)
        return lambda postures, margin: self._surroundings.depths(postures, base, Touching(load, margin, level))

    def _ways(self, grip: Grip | None) -> list[Array]:
        """Return postures by which the arm may go from one place to another."""
        return self._options(grip) if grip else [*self._options(None), *map(as_posture, self._arm.postures.between)]

    def _limits(self, postures: Sequence[Array]) -> tuple[Array, Array]:
        """Return between which postures the arm may look for a way from some of these to others."""
        turns = [float(posture[-1]) for posture in postures]
        return np.append(self._arm.lower, min(turns)), np.append(self._arm.upper, max(turns))

    def _change(self, grip: Grip | None, start: Array, goal: Array, base: Array, searching: bool) -> Path:
        """Return how the arm changes its posture on a drive: straight, if no other way is searched for."""
        if searching:
            return self._path(grip, start, [goal], base, True)
        return find_path(self._depths(base, grip), start, [goal], (), None)

    def _path(self, grip: Grip | None, start: Array, goals: Sequence[Array], base: Array, searching: bool) -> Path:
        """Return how the arm gets from one posture into one of others while the base stands somewhere."""
        limits = self._limits([start, *goals]) if searching else None
        return find_path(self._depths(base, grip), start, goals, self._ways(grip), limits)

    def _choose_reach(
        self, motion: Motion, point: Vector, level: float, base: Array, grips: tuple[Grip | None, Grip | None]
    ) -> Reach:
        """Choose how to reach a point.

        Args:
            motion: with the configuration that was decided on; it is taken if it is free.
            point: where the fingertips shall be.
            level: height of the surface that they may touch.
            base: where the base stands.
            grips: what the gripper holds on its way there, and on its way back.
        """
        assert motion.arm is not None
        x, y, yaw = base.tolist()
        found = self._arm.solutions(point, ((x, y, 0.0), yaw_quaternion(yaw)))
        held = next(grip for grip in grips if grip)
        targets = np.column_stack([np.vstack([motion.arm, found]), np.full(len(found) + 1, held.turn)])
        targets[:, -1 - self._arm.fingers : -1] = self._arm.opening(min(self._world.size(held.item)[:2]))
        above = np.column_stack([self._arm.above(targets[:, :-1], _CLEARANCE), targets[:, -1]])
        there, back = grips
        starts, ends = self._options(self._grip), [self._options(back)[number] for number in self._free(base, back)]
        free = self._free(base, self._grip)

        def depths(targets: Array, above: Array) -> Array:
            both = np.concatenate([targets, (targets + above) / 2, above])
            each = [self._depths(base, grip, level)(self._grasping(both, grip), 0.0) for grip in grips]
            deepest: Array = np.maximum(*each).reshape(3, -1).max(axis=0)
            return deepest

        def go_there(above: Array, searching: bool) -> tuple[int, int, Path]:
            goals, some = list(self._grasping(above, there)), [starts[option] for option in free]
            clear = self._depths(base, there)
            found = (
                search(clear, (some, goals), self._ways(there), self._limits([*some, *goals])) if searching else None
            )
            if found is not None:
                return found[1], free[found[0]], found[2]
            number, path = find_start(clear, some, goals[0])
            return 0, free[number], path

        def go_back(above: Array, searching: bool) -> Path:
            return self._path(back, self._grasping(above, back), ends, base, searching)

        return choose_reach(targets, above, depths, go_there, go_back)

    def _options(self, grip: Grip | None) -> list[Array]:
        """Return the postures in which the arm can be taken along."""
        postures = self._arm.postures
        if grip is None:
            return [as_posture(one) for one in postures.empty]
        return [as_posture(one, grip.turn) for one in postures.loaded]

    def _closed(self, postures: Array) -> Array:
        """Return postures with the fingers closed on an object."""
        closed, fingers = postures.copy(), self._arm.fingers
        closed[..., -1 - fingers : -1] = self._arm.carry[len(self._arm.carry) - fingers :]
        return closed

    def _grasping(self, postures: Array, grip: Grip | None) -> Array:
        """Return postures with the fingers as they are with or without an object."""
        return postures if grip is None else self._closed(postures)

    # Moving

    def _jump(self, posture: Array) -> None:
        """Leave at once the posture in which the state has the arm, where it is another than a free one."""
        if np.abs(posture - self._posture).max() > _CAUGHT_UP:
            self._physics.set_joints(self._name, posture[:-1].tolist())
            self._arm.drive(posture[:-1].tolist())
            self._posture = posture
            if self._grip is not None:
                self._physics.move_object(self._grip.item, self._held_pose(self._grip))
            self._level()

    def _follow(self, path: Path) -> Iterator[Tick]:
        for number, posture in enumerate(path.postures):
            exactly = not path.wide or number == len(path.postures) - 1
            yield from self._move_arm(posture, exactly, 1.0 if path.wide else _CAREFUL)

    def _move_arm(self, goal: Array, exactly: bool, share: float = 1.0) -> Iterator[Tick]:
        """Drive the joints' motors to a posture, and what is held to its yaw.

        Args:
            goal: the posture.
            exactly: whether to wait for the motors.
            share: of the usual speeds.
        """
        arm, start = self._arm, self._posture
        limits = share * (arm.speeds if self._grip is None else _WITH_LOAD * arm.speeds)
        for joints, speeds, done in trajectory.move_joints(start[:-1], goal[:-1], limits):
            arm.drive(joints, speeds)
            if self._grip is not None:
                self._grip = Grip(self._grip.item, float(start[-1] + done * (goal[-1] - start[-1])))
            self._level()
            yield _BY_MOTORS
        self._posture = goal
        arm.drive(goal[:-1])
        for _ in range(round(_CATCH_UP_TIME / TIME_STEP) if exactly else 0):
            if np.abs(np.subtract(goal[:-1], arm.configuration())).max() < _CAUGHT_UP:
                return
            self._level()
            yield _BY_MOTORS

    def _level(self) -> None:
        """Keep a held object upright in the gripper."""
        if self._grip is not None:
            self._physics.level(self._name, self._held_pose(self._grip))


def _check(position: Vector, goal: Vector) -> None:
    if np.linalg.norm(np.subtract(position, goal)) > TOLERANCE:
        raise MissedError
