"""The world: a home, and the state of what moves in it; physics follows the state when :meth:`World.sync` is called."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.free_space import Size, grip_point
from chmarl_pb.world.bodies import Pose, Vector
from chmarl_pb.world.client import Uncopied
from chmarl_pb.world.physics import Physics, RobotBody
from chmarl_pb.world.state import Grip, Objects, RobotState, Support, WorldState
from chmarl_pb.world.touch import box_of, touching


class World(Uncopied):
    """One home with its objects and robots.

    Every method that changes something replaces ``state``. PyBullet's bodies stay where they were until
    :meth:`sync`; the environment calls it in every reset and step, so whoever reads poses from
    ``client`` between steps finds every body where it is in the state.

    Attributes:
        home: the home.
        physics: what PyBullet holds.
        state: where everything is; assign an earlier state to return to it.
        graspers: names of the robots that can grasp.
    """

    def __init__(self, home: Home):
        """Load a home and the objects of every graspable class.

        Raises:
            HomeError: PyBullet cannot load the home.
            AssetError: the URDF of an object cannot be used.
        """
        self.home = home
        self.physics = Physics(home)
        self.state = WorldState()
        self._synced: WorldState | None = self.state  # what physics shows; None if bodies have moved by themselves
        self.graspers: tuple[str, ...] = ()

    @property
    def client(self) -> int:
        """PyBullet client id; its bodies are where they were at the last :meth:`sync`. Below 0 once it is closed."""
        return self.physics.client

    def close(self) -> None:
        """Disconnect from physics; closing twice is allowed."""
        self.physics.close()

    def sync(self) -> None:
        """Bring all bodies of physics to where they are in the state."""
        state, shown = self.state, self._synced
        if state is shown:
            return
        if shown is None or state.grips is not shown.grips:
            for robot in self.physics.robots:
                self.physics.release(robot)
        self._sync_objects(state.objects, None if shown is None else shown.objects)
        self._sync_robots(state.robots, {} if shown is None else shown.robots)
        if shown is None or state.grips is not shown.grips:
            for robot, grip in state.grips.items():
                self.physics.grip(robot, grip.item, state.objects.poses[grip.item])
        self._synced = state

    def sync_robots(self) -> None:
        """Bring the robots alone to where they are in the state, as to learn where a hand is that carries something."""
        state, shown = self.state, self._synced
        self._sync_robots(state.robots, {} if shown is None else shown.robots)
        if shown is not None:
            self._synced = WorldState(shown.objects, shown.grips, state.robots)

    def _sync_objects(self, objects: Objects, shown: Objects | None) -> None:
        if objects is shown:
            return
        before = dict.fromkeys(self.physics.objects) if shown is None else shown.poses
        for name in before.keys() - objects.poses.keys():
            self.physics.move_object(name, None)
        for name, pose in objects.poses.items():
            if before.get(name) is not pose:
                self.physics.move_object(name, pose)

    def _sync_robots(self, robots: Mapping[str, RobotState], shown: Mapping[str, RobotState]) -> None:
        for name, robot in robots.items():
            before = shown.get(name)
            if robot is not before:
                self.physics.move_robot(name, robot.base)
                if robot.joints and (before is None or before.joints != robot.joints):
                    self.physics.set_joints(name, robot.joints)

    def moved(self) -> None:
        """Note that bodies of physics are no longer where they were in the state: the next sync puts back all."""
        self._synced = None

    # Robots

    def add_robot(self, name: str, body: RobotBody) -> None:
        """Tell physics which body is a robot's; it is at its place once :meth:`set_robot` has said where that is."""
        self.physics.robots[name] = body
        self.graspers = tuple(name for name, robot in self.physics.robots.items() if robot.grasp_link is not None)

    @property
    def robots(self) -> Mapping[str, RobotState]:
        """Robot -> where it is."""
        return self.state.robots

    def set_robot(self, name: str, robot: RobotState) -> None:
        """Let a robot be somewhere."""
        state = self.state
        if state.robots.get(name) is not robot:
            self.state = WorldState(state.objects, state.grips, {**state.robots, name: robot})

    # Objects

    @property
    def bodies(self) -> dict[str, int]:
        """Name -> PyBullet body id of the home, the robots and the objects present."""
        robots = {name: robot.body for name, robot in self.physics.robots.items()}
        return {"home": self.physics.home, **robots, **{name: self.physics.objects[name].body for name in self.objects}}

    @property
    def objects(self) -> list[str]:
        """Names of the objects present, in the catalogue's order."""
        poses = self.state.objects.poses
        return [name for name in self.physics.objects if name in poses]

    @property
    def links(self) -> Mapping[str, int]:
        """Name of a part of the home -> PyBullet link index."""
        return self.physics.links

    @property
    def supports(self) -> Mapping[str, Support]:
        """Object -> what carries it; one in a gripper is not in it."""
        return self.state.objects.supports

    def size(self, name: str) -> Size:
        """Return an object's extents x, y, z in metres."""
        return self.physics.objects[name].size

    def pose(self, name: str) -> Pose:
        """Return an object's bottom centre (metres) and its orientation (x, y, z, w)."""
        return self.state.objects.poses[name]

    def grip(self, name: str) -> tuple[float, float, float]:
        """Return the point where an object that stands is gripped."""
        x, y, z = self.pose(name)[0]
        return grip_point((x, y, z), self.size(name))

    def arrange(self, objects: Objects) -> None:
        """Let these objects be in the home and no others, none of them in a gripper."""
        self.state = WorldState(objects, {}, self.state.robots)

    def clear(self) -> None:
        """Take all objects out of the home."""
        self.arrange(Objects())

    def place(self, name: str, position: Vector, quaternion: Vector, receptacle: str | None = None) -> None:
        """Set an object's pose, without physics.

        Args:
            name: the object.
            position: of its bottom centre, metres.
            quaternion: its orientation (x, y, z, w).
            receptacle: name of what carries it there; None if nothing does, as in a gripper.
        """
        support = None if receptacle is None else Support(receptacle, position[2])
        self._set(name, (tuple(position), tuple(quaternion)), support, self.state.grips)

    def _set(self, name: str, pose: Pose, support: Support | None, grips: Mapping[str, Grip]) -> None:
        objects = self.state.objects
        supports = objects.supports
        if name in supports:
            supports = {one: on for one, on in supports.items() if one != name}
        if support is not None:
            supports = {**supports, name: support}
        self.state = WorldState(Objects({**objects.poses, name: pose}, supports), grips, self.state.robots)

    def taken(self, places: NDArray[np.floating], size: Size, ignoring: Sequence[str] = ()) -> NDArray[np.bool_]:
        """Return at which places an object of this size would touch an object that stands.

        Args:
            places: (n, 4) x, y, z and yaw of its bottom centre.
            size: extents along its own axes, metres.
            ignoring: names of objects that do not count; those in grippers never do.
        """
        skipped = {*ignoring, *self.state.held}
        poses = self.state.objects.poses
        boxes = [box_of(pose, self.size(name)) for name, pose in poses.items() if name not in skipped]
        return touching(places, size, np.array(boxes, dtype=np.float64).reshape(-1, 7))

    # Holding

    @property
    def held(self) -> str | None:
        """Name of the object in a gripper, or None."""
        return next(iter(self.state.held), None)

    def hold(self, robot: str, grip: Grip, pose: Pose) -> None:
        """Let a robot hold an object whose bottom centre is at a pose."""
        grips = self.state.grips
        self._set(grip.item, pose, None, grips if grips.get(robot) is grip else {**grips, robot: grip})

    def set_down(self, robot: str, position: Vector, yaw: float, receptacle: str) -> bool:
        """Let a robot open its gripper just above a place, and let physics settle what it held.

        Returns:
            Whether it came to rest upright and the receptacle carries it. If not, the state is as it was.
        """
        self.sync()
        item = self.state.grips[robot].item
        self.physics.release(robot)
        settled = self.physics.set_down(item, position, yaw, receptacle)
        self.moved()
        if settled is None:
            return False
        grips = {name: grip for name, grip in self.state.grips.items() if name != robot}
        self._set(item, settled, Support(receptacle, position[2]), grips)
        return True
