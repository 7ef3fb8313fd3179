"""The humanoid: drives on the lattice, picks and places with its arm."""

from weakref import WeakKeyDictionary, proxy

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.navigation.free_space import GRIP, Space, grip_point
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.motion import Motion, Placement
from chmarl_pb.world import UPRIGHT, Pose, World, yaw_quaternion
from chmarl_pb.world.bullet import pybullet

_REMEMBERED = 10_000  # reaches whose inverse kinematics is kept
_TRIED_PLACES = 400  # nearest places that Place looks at before it gives up

Reaches = dict[tuple[int, tuple[float, float, float]], Configuration | None]  # pose and grip -> the arm's configuration
_reaches: WeakKeyDictionary[Space, Reaches] = WeakKeyDictionary()  # shared by all who play in a home


def load_humanoid(client: int) -> int:
    """Load the humanoid's body into a client; the lattice keeps it clear of the home, so it collides with nothing."""
    path, flags = str(catalog.robot_urdf("humanoid")), pybullet.URDF_USE_INERTIA_FROM_FILE
    body = pybullet.loadURDF(path, useFixedBase=True, flags=flags, physicsClientId=client)
    for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
        pybullet.setCollisionFilterGroupMask(body, link, 0, 0, physicsClientId=client)
    return int(body)


class Humanoid:
    """The humanoid in one world.

    Attributes:
        pose: pose on the lattice (position and heading in one number).
        actions: names of its actions, in the order of their numbers.
        arm: its arm.
        turn: yaw of the held object relative to the base, radians.
    """

    name = "humanoid"

    def __init__(self, world: World, space: Space):
        """Load the humanoid into a world."""
        self.world: World = proxy(world)  # which holds its robots: held by them it would have to be garbage-collected
        self.space, self.lattice = space, space.lattice
        gotos = (f"goto_{room}" for room in self.lattice.anchors)
        self.actions = (*gotos, "pick", "place", "move_forward", "turn_left", "turn_right", "stay")
        self.body = load_humanoid(world.physics)
        self.arm = Arm(world.physics, self.body)
        self.pose, self.turn, self._arm_steps = 0, 0.0, -1
        self._base: tuple[int, Pose] = (-1, ((0.0, 0.0, 0.0), UPRIGHT))
        self._reached = _reaches.setdefault(space, {})
        world.add_robot(self.name, self, self.body)

    @property
    def room(self) -> int:
        """Index of its room in ``list(home.rooms)``."""
        return int(self.lattice.rooms[self.pose // HEADINGS])

    @property
    def heading(self) -> int:
        """Heading in steps of 30 degrees."""
        return self.pose % HEADINGS

    def spawn(self, pose: int) -> None:
        """Stand at a pose with the arm at rest, or carrying what is held."""
        self.pose = pose
        self.set_base(*self.base_pose())
        configuration = Arm.carry if self.world.held else Arm.rest
        # Physics lets the joints give way a little.
        if (configuration, self.world.steps) != (self.arm.last, self._arm_steps):
            self.arm.set(configuration)
            self._arm_steps = self.world.steps
        if self.world.held:
            self.world.place(self.world.held, *self.held_pose(self.world.held))

    def base_pose(self) -> Pose:
        """Return the position (metres) and orientation (x, y, z, w) that its lattice pose means."""
        if self._base[0] != self.pose:
            x, y, yaw = self.lattice.pose(self.pose)
            self._base = self.pose, ((x, y, 0.0), yaw_quaternion(yaw))
        return self._base[1]

    def read_base(self) -> Pose:
        """Return the body's present position (metres) and orientation (x, y, z, w)."""
        return pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self.world.physics)

    def set_base(self, position: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
        """Move the body."""
        self.world.move_body(self.body, position, quaternion)

    def grasp_pose(self) -> Pose:
        """Return position and quaternion of the point between the fingertips, see :meth:`Arm.grasp_pose`."""
        self.arm.client = self.world.physics  # by asking for it, the base gets to where it belongs
        return self.arm.grasp_pose()

    def held_pose(self, name: str) -> Pose:
        """Return the pose of an object in the gripper: upright, gripped at its grip, turned with the base."""
        (x, y, z), _ = self.grasp_pose()
        _, quaternion = self.read_base()
        yaw = 2 * np.arctan2(quaternion[2], quaternion[3]) + self.turn
        return (float(x), float(y), float(z - GRIP * self.world.size(name)[2])), yaw_quaternion(yaw)

    # Deciding

    def plan(self, action: str, goal: Goal, seen: tuple[str, ...]) -> Motion | None:
        """Decide what an action does.

        Args:
            action: one of ``actions``.
            goal: what Pick and Place act on.
            seen: names of the things in its view.

        Returns:
            The motion, or None if the action fails.
        """
        if action == "pick":
            return self._plan_pick(goal.item) if goal.item in seen and self.world.held is None else None
        if action == "place":
            in_view = [name for name in goal.receptacles if name in seen]
            return self._plan_place(goal.item, in_view) if self.world.held == goal.item else None
        return self._plan_drive(action)

    def _plan_drive(self, action: str) -> Motion | None:
        position, heading = divmod(self.pose, HEADINGS)
        if action.startswith("goto_"):
            return Motion(self.lattice.anchors[action.removeprefix("goto_")])
        if action == "move_forward":
            ahead = int(self.lattice.forward[position, heading])
            return None if ahead < 0 else Motion(ahead * HEADINGS + heading)
        turn = {"turn_left": 1, "turn_right": -1, "stay": 0}[action]
        return Motion(position * HEADINGS + (heading + turn) % HEADINGS)

    def _plan_pick(self, item: str) -> Motion | None:
        grip = self.world.grip(item)
        stand = self.space.stand(grip)
        arm = None if stand is None else self._reach(stand, grip)
        if stand is None or arm is None:
            return None
        return Motion(stand, arm=arm, pick=item)

    def _plan_place(self, item: str, receptacles: list[str]) -> Motion | None:
        """Decide on the nearest free place of the nearest receptacle in view that the arm reaches."""
        x, y, _ = self.lattice.pose(self.pose)
        size = self.world.size(item)
        for receptacle in sorted(receptacles, key=lambda name: _distance(self.space, name, x, y)):
            places = self.space.places(receptacle, size)
            places = places[~self.world.taken(places, size, ignoring=item)]
            order = np.argsort(np.hypot(places[:, 0] - x, places[:, 1] - y), kind="stable")
            for px, py, pz, yaw in places[order[:_TRIED_PLACES]].tolist():
                grip = grip_point((px, py, pz), size)
                stand = self.space.stand(grip)
                arm = None if stand is None else self._reach(stand, grip)
                if stand is not None and arm is not None:
                    placement = Placement(receptacle, (px, py, pz), yaw)
                    return Motion(stand, arm=arm, place=placement)
        return None

    def _reach(self, stand: int, grip: tuple[float, float, float]) -> tuple[float, ...] | None:
        """Return the arm's configuration that reaches a point from a pose; the body stays where it is."""
        if (stand, grip) not in self._reached:
            if len(self._reached) == _REMEMBERED:
                self._reached.clear()
            x, y, yaw = self.lattice.pose(stand)
            pybullet.resetBasePositionAndOrientation(
                self.body, (x, y, 0.0), yaw_quaternion(yaw), physicsClientId=self.arm.client
            )
            self._reached[stand, grip] = self.arm.solve(grip)
            self.set_base(*self.base_pose())
        return self._reached[stand, grip]

    # Acting

    def finish(self, motion: Motion) -> bool:
        """Set the result of a motion; on failure the world is as it was before.

        Returns:
            Whether the motion succeeded: only letting an object go can fail.
        """
        if motion.place is not None:
            return self._finish_place(motion)
        if motion.pick is not None:
            self.turn = self.turn_of(motion.pick, motion.pose)
        self.spawn(motion.pose)
        if motion.pick is not None:
            self.hold(motion.pick)
        return True

    def hold(self, item: str) -> None:
        """Take an object into the gripper, the arm in its carry configuration."""
        self.arm.set(Arm.carry)
        self.world.place(item, *self.held_pose(item))
        self.world.attach(item, self.body, self.arm.grasp_link, self.grasp_pose())

    def turn_of(self, item: str, stand: int) -> float:
        """Return the yaw in radians of an object relative to the base at a pose."""
        quaternion = self.world.pose(item)[1]
        return float(2 * np.arctan2(quaternion[2], quaternion[3]) - self.lattice.pose(stand)[2])

    def _finish_place(self, motion: Motion) -> bool:
        item, placement, start = self.world.held, motion.place, self.pose
        assert item is not None and placement is not None
        self.world.release()
        if self.world.set_down(item, placement.position, placement.yaw, placement.receptacle):
            self.spawn(motion.pose)
            return True
        self.spawn(start)
        self.hold(item)
        return False


def _distance(space: Space, receptacle: str, x: float, y: float) -> float:
    centre = space.home.receptacles[receptacle].centre
    return float(np.hypot(centre[0] - x, centre[1] - y))
