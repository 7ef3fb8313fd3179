"""The drone: kinematic, on its own lattice 3.5 m above the floor, looking straight down."""

from weakref import proxy

from chmarl_pb import catalog
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import DRONE_HEADING, DRONE_HEIGHT
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import UPRIGHT, Pose, World, yaw_quaternion
from chmarl_pb.world.bullet import pybullet

_MOVES = ("move_forward", "move_backward", "move_left", "move_right")


def load_drone(client: int) -> int:
    """Load the drone's body into a client; it touches nothing."""
    body = pybullet.loadURDF(str(catalog.robot_urdf("drone")), useFixedBase=True, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(body, -1, 0, 0, physicsClientId=client)
    return int(body)


class Drone:
    """The drone in one world.

    Attributes:
        pose: position on the drone's lattice.
        actions: names of its actions, in the order of their numbers.
    """

    name = "drone"

    def __init__(self, world: World, space: Space):
        """Load the drone into a world."""
        self.world: World = proxy(world)  # which holds its robots: held by them it would have to be garbage-collected
        self.lattice = space.drone_lattice
        self.actions = (*(f"goto_{room}" for room in self.lattice.anchors), *_MOVES, "stay")
        self.body = load_drone(world.physics)
        self.pose = 0
        self._base: tuple[int, Pose] = (-1, ((0.0, 0.0, 0.0), UPRIGHT))
        world.add_robot(self.name, self, self.body)

    @property
    def room(self) -> int:
        """Index of the room below it in ``list(home.rooms)``."""
        return int(self.lattice.rooms[self.pose])

    def spawn(self, pose: int) -> None:
        """Set it above a lattice position."""
        self.pose = pose
        self.set_base(*self.base_pose())

    def base_pose(self) -> Pose:
        """Return the position (metres) and orientation (x, y, z, w) that its lattice pose means."""
        if self._base[0] != self.pose:
            x, y = self.lattice.points[self.pose].tolist()
            self._base = self.pose, ((x, y, DRONE_HEIGHT), yaw_quaternion(DRONE_HEADING))
        return self._base[1]

    def read_base(self) -> Pose:
        """Return the body's present position (metres) and orientation (x, y, z, w)."""
        return pybullet.getBasePositionAndOrientation(self.body, physicsClientId=self.world.physics)

    def set_base(self, position: tuple[float, ...], quaternion: tuple[float, ...]) -> None:
        """Move the body."""
        self.world.move_body(self.body, position, quaternion)

    def plan(self, action: str) -> Motion | None:
        """Decide what an action does; None if it is blocked by the home's outline."""
        if action == "stay":
            return Motion(self.pose)
        if action.startswith("goto_"):
            goal = self.lattice.anchors[action.removeprefix("goto_")]
        else:
            goal = int(self.lattice.moves[self.pose, _MOVES.index(action)])
        return None if goal < 0 else Motion(goal)

    def finish(self, motion: Motion) -> bool:
        """Set the result of a motion."""
        self.spawn(motion.pose)
        return True
