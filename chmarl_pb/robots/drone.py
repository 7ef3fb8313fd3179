"""The drone: kinematic, on its own lattice 3.5 m above the floor, looking straight down."""

from chmarl_pb import catalog
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import DRONE_HEADING, DRONE_HEIGHT, heading_angle
from chmarl_pb.robots.motion import Motion
from chmarl_pb.world import RobotBody, RobotState, World, yaw_quaternion
from chmarl_pb.world.bullet import pybullet

_HEADING = round(DRONE_HEADING / heading_angle(1))
_MOVES = ("move_forward", "move_backward", "move_left", "move_right")


def load_drone(client: int) -> int:
    """Load the drone's body into a client; it touches nothing."""
    body = pybullet.loadURDF(str(catalog.robot_urdf("drone")), useFixedBase=True, physicsClientId=client)
    pybullet.setCollisionFilterGroupMask(body, -1, 0, 0, physicsClientId=client)
    return int(body)


class Drone:
    """The drone in one world.

    Attributes:
        actions: names of its actions, in the order of their numbers.
    """

    name = "drone"

    def __init__(self, world: World, space: Space):
        """Load the drone into a world."""
        self.world = world
        self.lattice = space.drone_lattice
        self.actions = (*(f"goto_{room}" for room in self.lattice.anchors), *_MOVES, "stay")
        self._states: dict[int, RobotState] = {}  # the same pose is the same object: nothing has moved
        world.add_robot(self.name, RobotBody(load_drone(world.client)))
        self.spawn(0)

    @property
    def pose(self) -> int:
        """Its position on the drone's lattice."""
        return self.world.state.robots[self.name].pose

    def spawn(self, pose: int) -> None:
        """Set it above a lattice position."""
        state = self._states.get(pose)
        if state is None:
            x, y = self.lattice.points[pose].tolist()
            base = (x, y, DRONE_HEIGHT), yaw_quaternion(DRONE_HEADING)
            state = self._states[pose] = RobotState(pose, int(self.lattice.rooms[pose]), _HEADING, base)
        self.world.set_robot(self.name, state)

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
