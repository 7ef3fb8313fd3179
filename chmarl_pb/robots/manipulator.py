"""A robot with an arm: drives, picks and places."""

import math
from collections.abc import Collection, Iterator
from dataclasses import replace
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np

from chmarl_pb.navigation.approaches import Approaches
from chmarl_pb.navigation.free_space import GRIP, Space, grip_point
from chmarl_pb.robots.clearance import Obstacles
from chmarl_pb.robots.driven_arm import DrivenArm
from chmarl_pb.robots.gauge import Gauge
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.mobile import MobileRobot
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.motion import Motion, Placement, Tick
from chmarl_pb.robots.motors import Configuration
from chmarl_pb.robots.own_arm import load_arm
from chmarl_pb.robots.surroundings import Surroundings
from chmarl_pb.world import Grip, Pose, RobotBody, World, yaw_quaternion

_REMEMBERED = 10_000  # reaches whose inverse kinematics is kept
_MEASURED = 4  # simulation steps between two measurements of how deep a driven arm stands in something
_TRIED_PLACES = 400  # nearest places that Place looks at before it gives up

Reaches = dict[tuple[int, tuple[float, float, float]], Configuration | None]  # pose and grip -> the arm's configuration
_reaches: WeakKeyDictionary[Approaches, dict[RobotModel, Reaches]] = WeakKeyDictionary()  # shared by all in a home


class MobileManipulator(MobileRobot):
    """A robot in one world that moves, picks and places; see :class:`chmarl_pb.robots.robot.Robot`.

    Attributes:
        arm: its arm.
    """

    arm_actions = ("pick", "place")

    def __init__(self, model: RobotModel, world: World, space: Space, name: str):
        """Load the robot into a world.

        Raises:
            AssetError: its URDF cannot be loaded, or has no arm that this package knows.
            HomeError: it cannot reach a room.
        """
        assert model.reach is not None, "a robot with an arm says how far it reaches"
        self._approaches = space.approaches(model.footprint, model.reach)
        self._reached = _reaches.setdefault(self._approaches, {}).setdefault(model, {})
        super().__init__(model, world, space, name)

    def _in_physics(self) -> RobotBody:
        self.arm, self._shape = load_arm(self.model, self.world.client, self.body)
        return RobotBody(self.body, self.arm.indices, self.arm.grasp_link, self.arm.grasp)

    @property
    def held(self) -> str | None:
        """Name of the object in its gripper, or None."""
        grip = self.world.state.grips.get(self.name)
        return None if grip is None else grip.item

    def spawn(self, pose: int) -> None:
        """Stand at a pose with the arm at rest, or carrying what is held."""
        grip = self.world.state.grips.get(self.name)
        self._stand(pose, self.arm.rest if grip is None else self.arm.carry)
        if grip is not None:
            self._carry(grip)

    def hold(self, item: str, turn: float = 0.0) -> None:
        """Take an object into the gripper, the arm in its carry configuration.

        Args:
            item: the object.
            turn: its yaw relative to the base, radians.
        """
        self._stand(self.pose, self.arm.carry)
        self._carry(Grip(item, turn))

    def _carry(self, grip: Grip) -> None:
        """Hold an object where the hand is now."""
        self.world.sync_robots()
        self.world.hold(self.name, grip, self.held_pose(grip))

    def held_pose(self, grip: Grip) -> Pose:
        """Return the pose of an object in the gripper as physics has it: upright, at its grip, turned with the base."""
        physics = self.world.physics
        (x, y, z), _ = physics.grasp_pose(self.name)
        _, quaternion = physics.read_base(self.name)
        yaw = 2 * math.atan2(quaternion[2], quaternion[3]) + grip.turn
        return (float(x), float(y), float(z - GRIP * self.world.size(grip.item)[2])), yaw_quaternion(yaw)

    # Deciding

    def plan(
        self, action: str, goal: Goal | None = None, seen: Collection[str] = (), taken: Collection[int] = ()
    ) -> Motion | None:
        """Decide what an action does; None if it fails."""
        if action not in self.arm_actions:
            return super().plan(action, goal, seen, taken)
        if goal is None:
            return None
        if action == "pick":
            stands = self.held is None and goal.item in self.world.supports
            return self._plan_pick(goal.item, taken) if stands and goal.item in seen else None
        in_view = [name for name in goal.receptacles if name in seen]
        return self._plan_place(goal.item, in_view, taken) if self.held == goal.item else None

    def stand(self, item: str, taken: Collection[int] = ()) -> int | None:
        """Return the pose from which it reaches an object that stands best, or None."""
        return self._approaches.stand(self.world.grip(item), taken)

    def _plan_pick(self, item: str, taken: Collection[int]) -> Motion | None:
        stand = self.stand(item, taken)
        arm = None if stand is None else self._reach(stand, self.world.grip(item))
        if stand is None or arm is None:
            return None
        return Motion(stand, arm=arm, pick=item)

    def _plan_place(self, item: str, receptacles: list[str], taken: Collection[int]) -> Motion | None:
        """Decide on the nearest free place of the nearest receptacle in view that the arm reaches."""
        x, y, _ = self.lattice.pose(self.pose)
        size = self.world.size(item)
        for receptacle in sorted(receptacles, key=lambda name: _distance(self.space, name, x, y)):
            places = self.space.places(receptacle, size)
            places = places[~self.world.taken(places, size, ignoring=(item,))]
            order = np.argsort(np.hypot(places[:, 0] - x, places[:, 1] - y), kind="stable")
            for px, py, pz, yaw in places[order[:_TRIED_PLACES]].tolist():
                grip = grip_point((px, py, pz), size)
                stand = self._approaches.stand(grip, taken)
                arm = None if stand is None else self._reach(stand, grip)
                if stand is not None and arm is not None:
                    placement = Placement(receptacle, (px, py, pz), yaw)
                    return Motion(stand, arm=arm, place=placement)
        return None

    def _reach(self, stand: int, grip: tuple[float, float, float]) -> tuple[float, ...] | None:
        """Return the arm's configuration that reaches a point from a pose."""
        if (stand, grip) not in self._reached:
            if len(self._reached) == _REMEMBERED:
                self._reached.clear()
            self._reached[stand, grip] = self.arm.solve(grip, self.model.base(self.space, stand))
        return self._reached[stand, grip]

    # Acting

    def finish(self, motion: Motion) -> bool:
        """Set the result of a motion; on failure the world is as it was before.

        Returns:
            Whether the motion succeeded: another robot may have taken the object or the place, and what is let go
            may not come to rest.
        """
        put = motion.place
        if motion.pick is not None and motion.pick not in self.world.supports:
            return False
        if put is not None and not self._put(put):
            return False
        self.spawn(motion.pose)
        if motion.pick is not None:
            self.hold(motion.pick, self.turn_of(motion.pick, motion.pose))
        return True

    def _put(self, put: Placement) -> bool:
        """Let go of what is held; return whether it stands where it should."""
        item = self.held
        assert item is not None, "Place is planned with an object in the gripper"
        place = np.array([[*put.position, put.yaw]])
        if self.world.taken(place, self.world.size(item), ignoring=(item,)).any():
            return False
        return self.world.set_down(self.name, put.position, put.yaw, put.receptacle)

    def turn_of(self, item: str, stand: int) -> float:
        """Return the yaw in radians of an object relative to the base at a pose."""
        quaternion = self.world.pose(item)[1]
        return float(2 * math.atan2(quaternion[2], quaternion[3]) - self.lattice.pose(stand)[2])

    def get_ready(self) -> None:
        """Let the motors keep the arm where it is: they may still have the goal of an earlier motion."""
        self.arm.drive(self.arm.configuration())

    def drive(self, motion: Motion) -> Iterator[Tick]:
        """Move base and arm in physics alone, one simulation step at a time, and measure where they touch.

        Raises:
            MissedError: the hand or the object has missed its target.
        """
        ignoring = () if motion.pick is None else (motion.pick,)
        around = Surroundings(self._shape, self._solids, self.world, ignoring)
        arm = DrivenArm(self.name, self.arm, self.world, self.held_pose, around)
        turn = 0.0 if motion.pick is None else self.turn_of(motion.pick, motion.pose)
        legs = [leg for leg in self._legs(motion) if len(leg)]
        gauge = Gauge(self.world, self.name, self._shape, motion)
        for number, tick in enumerate(arm.act(motion, legs, np.array(self.lattice.pose(motion.pose)), turn)):
            yield replace(tick, depth=gauge.depth(arm.held)) if number % _MEASURED == 0 else tick

    @cached_property
    def _solids(self) -> Obstacles:
        return Obstacles((solid.polygon, solid.bottom, solid.top) for solid in self.space.home.solids)


def _distance(space: Space, receptacle: str, x: float, y: float) -> float:
    centre = space.home.receptacles[receptacle].centre
    return float(np.hypot(centre[0] - x, centre[1] - y))
