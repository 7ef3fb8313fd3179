"""The humanoid: drives on the lattice, picks and places with its arm."""

from weakref import WeakKeyDictionary

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.navigation.free_space import GRIP, Space, grip_point
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.motion import Motion, Placement
from chmarl_pb.world import Grip, Pose, RobotBody, RobotState, World, yaw_quaternion
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
        actions: names of its actions, in the order of their numbers.
        arm: its arm.
    """

    name = "humanoid"

    def __init__(self, world: World, space: Space):
        """Load the humanoid into a world."""
        self.world, self.space, self.lattice = world, space, space.lattice
        gotos = (f"goto_{room}" for room in self.lattice.anchors)
        self.actions = (*gotos, "pick", "place", "move_forward", "turn_left", "turn_right", "stay")
        self.body = load_humanoid(world.client)
        self.arm = Arm(world.client, self.body)
        self._states: dict[tuple[int, Configuration], RobotState] = {}  # the same pose is the same object
        self._reached = _reaches.setdefault(space, {})
        world.add_robot(self.name, RobotBody(self.body, self.arm.indices, self.arm.grasp_link))
        self.spawn(0)

    @property
    def pose(self) -> int:
        """Its pose on the lattice: position and heading in one number."""
        return self.world.state.robots[self.name].pose

    @property
    def held(self) -> str | None:
        """Name of the object in its gripper, or None."""
        grip = self.world.state.grips.get(self.name)
        return None if grip is None else grip.item

    def spawn(self, pose: int) -> None:
        """Stand at a pose with the arm at rest, or carrying what is held."""
        grip = self.world.state.grips.get(self.name)
        self._stand(pose, Arm.rest if grip is None else Arm.carry)
        if grip is not None:
            self._carry(grip)

    def hold(self, item: str, turn: float = 0.0) -> None:
        """Take an object into the gripper, the arm in its carry configuration.

        Args:
            item: the object.
            turn: its yaw relative to the base, radians.
        """
        self._stand(self.pose, Arm.carry)
        self._carry(Grip(item, turn))

    def _stand(self, pose: int, configuration: Configuration) -> None:
        state = self._states.get((pose, configuration))
        if state is None:
            x, y, yaw = self.lattice.pose(pose)
            position, heading = divmod(pose, HEADINGS)
            room, base = int(self.lattice.rooms[position]), ((x, y, 0.0), yaw_quaternion(yaw))
            state = RobotState(pose, room, heading, base, configuration)
            self._states[pose, configuration] = state
        self.world.set_robot(self.name, state)

    def _carry(self, grip: Grip) -> None:
        """Hold an object where the hand is now."""
        self.world.sync_robots()
        self.world.hold(self.name, grip, self.held_pose(grip))

    def held_pose(self, grip: Grip) -> Pose:
        """Return the pose of an object in the gripper as physics has it: upright, at its grip, turned with the base."""
        physics = self.world.physics
        (x, y, z), _ = physics.grasp_pose(self.name)
        _, quaternion = physics.read_base(self.name)
        yaw = 2 * np.arctan2(quaternion[2], quaternion[3]) + grip.turn
        return (float(x), float(y), float(z - GRIP * self.world.size(grip.item)[2])), yaw_quaternion(yaw)

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
            return self._plan_pick(goal.item) if goal.item in seen and self.held is None else None
        if action == "place":
            in_view = [name for name in goal.receptacles if name in seen]
            return self._plan_place(goal.item, in_view) if self.held == goal.item else None
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
            places = places[~self.world.taken(places, size, ignoring=(item,))]
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
        """Return the arm's configuration that reaches a point from a pose."""
        if (stand, grip) not in self._reached:
            if len(self._reached) == _REMEMBERED:
                self._reached.clear()
            x, y, yaw = self.lattice.pose(stand)
            self._reached[stand, grip] = self.arm.solve(grip, ((x, y, 0.0), yaw_quaternion(yaw)))
        return self._reached[stand, grip]

    # Acting

    def finish(self, motion: Motion) -> bool:
        """Set the result of a motion; on failure the world is as it was before.

        Returns:
            Whether the motion succeeded: only letting an object go can fail.
        """
        put = motion.place
        if put is not None and not self.world.set_down(self.name, put.position, put.yaw, put.receptacle):
            return False
        self.spawn(motion.pose)
        if motion.pick is not None:
            self.hold(motion.pick, self.turn_of(motion.pick, motion.pose))
        return True

    def turn_of(self, item: str, stand: int) -> float:
        """Return the yaw in radians of an object relative to the base at a pose."""
        quaternion = self.world.pose(item)[1]
        return float(2 * np.arctan2(quaternion[2], quaternion[3]) - self.lattice.pose(stand)[2])


def _distance(space: Space, receptacle: str, x: float, y: float) -> float:
    centre = space.home.receptacles[receptacle].centre
    return float(np.hypot(centre[0] - x, centre[1] - y))
