"""A robot that moves and looks: on the ground, or over the walls."""

from collections.abc import Collection, Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import Lattice
from chmarl_pb.robots import trajectory
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.motion import Motion, Tick
from chmarl_pb.robots.robot import Robot
from chmarl_pb.world import RobotBody, RobotState, Vector, World, yaw_quaternion

_Joints = tuple[float, ...]


class MobileRobot:
    """A robot in one world that moves on its lattice; see :class:`chmarl_pb.robots.robot.Robot`.

    Attributes:
        name: of the agent.
        model: what is known of its kind.
        world: the world that it is in.
        space: what its home offers.
        lattice: where it can be.
        body: PyBullet body id.
        actions: names of its actions, in the order of their numbers.
        neighbours: the other robots on its lattice.
    """

    arm_actions: tuple[str, ...] = ()

    def __init__(self, model: RobotModel, world: World, space: Space, name: str):
        """Load the robot into a world.

        Raises:
            AssetError: its URDF cannot be loaded.
            HomeError: it cannot reach a room.
        """
        self.name, self.model, self.world, self.space = name, model, world, space
        self.lattice = model.lattice(space)
        self.neighbours: Sequence[Robot] = ()
        moves = (*(f"goto_{room}" for room in self.lattice.anchors), *self.lattice.steps)
        self._columns = {action: number for number, action in enumerate(moves)}
        rooms = len(self.lattice.anchors)
        self.actions = (*moves[:rooms], *self.arm_actions, *moves[rooms:], "stay")
        self._states: dict[tuple[int, _Joints], RobotState] = {}  # the same pose is the same object
        self.body = model.load(world.client)
        world.add_robot(name, self._in_physics())
        self.spawn(0)

    @property
    def pose(self) -> int:
        """Its pose on the lattice."""
        return self.world.state.robots[self.name].pose

    def spawn(self, pose: int) -> None:
        """Be at a pose."""
        self._stand(pose)

    def plan(
        self, action: str, goal: Goal | None = None, seen: Collection[str] = (), taken: Collection[int] = ()
    ) -> Motion | None:
        """Decide what an action does; None if it fails."""
        pose = self.pose
        end = pose if action == "stay" else int(self.lattice.moves[pose, self._columns[action]])
        if taken and end >= 0 and self.lattice.cell(end) in taken:
            end = self.lattice.nearest(end, taken) if action.startswith("goto_") else -1
        return None if end < 0 else Motion(end)

    def finish(self, motion: Motion) -> bool:
        """Set the result of a motion, which cannot fail."""
        self.spawn(motion.pose)
        return True

    def get_ready(self) -> None:
        """Prepare to be driven: nothing is to be done."""

    def drive(self, motion: Motion) -> Iterator[Tick]:
        """Move the base in physics alone, one simulation step at a time."""
        moved = Tick(by_motors=False)
        for base in self._way(motion):
            self.world.physics.move_robot(self.name, base)
            yield moved

    def _way(self, motion: Motion) -> Iterator[tuple[Vector, Vector]]:
        """Yield where the base is on its way, at every simulation step."""
        height = self.model.altitude
        if isinstance(self.lattice, Lattice):
            for leg in self._legs(motion):
                for x, y, turned in leg.tolist():
                    yield (x, y, height), yaw_quaternion(turned)
        else:
            (*start, yaw), (*end, _) = self.lattice.pose(self.pose), self.lattice.pose(motion.pose)
            for x, y in trajectory.fly(start, end, self.model.speed):
                yield (x, y, height), yaw_quaternion(yaw)

    def _legs(self, motion: Motion) -> Iterator[NDArray[np.float64]]:
        """Yield the legs (n, 3) of a drive: x, y and yaw at every simulation step."""
        lattice, model = self.lattice, self.model
        assert isinstance(lattice, Lattice)
        path = lattice.path(lattice.cell(self.pose), lattice.cell(motion.pose))
        start, end = lattice.pose(self.pose)[2], lattice.pose(motion.pose)[2]
        return trajectory.drive(lattice.waypoints(tuple(path)), start, end, model.speed, model.turn_speed)

    def _in_physics(self) -> RobotBody:
        return RobotBody(self.body)

    def _stand(self, pose: int, joints: _Joints = ()) -> None:
        state = self._states.get((pose, joints))
        if state is None:
            lattice, base = self.lattice, self.model.base(self.space, pose)
            room = int(lattice.rooms[lattice.cell(pose)])
            state = RobotState(pose, room, lattice.heading(pose), base, joints)
            self._states[pose, joints] = state
        self.world.set_robot(self.name, state)
