"""The world: a home, the state of what moves in it, and one PyBullet client that follows the state."""

from chmarl_pb.world.bodies import (
    UPRIGHT,
    Graspable,
    Pose,
    Vector,
    loaded_graspables,
    loaded_home,
    yaw_quaternion,
)
from chmarl_pb.world.bullet import quiet
from chmarl_pb.world.client import Client, Uncopied
from chmarl_pb.world.physics import TIME_STEP, Physics, RobotBody
from chmarl_pb.world.state import Grip, Objects, RobotState, Support, WorldState
from chmarl_pb.world.world import World

__all__ = [
    "TIME_STEP",
    "UPRIGHT",
    "Client",
    "Graspable",
    "Grip",
    "Objects",
    "Physics",
    "Pose",
    "RobotBody",
    "RobotState",
    "Support",
    "Uncopied",
    "Vector",
    "World",
    "WorldState",
    "loaded_graspables",
    "loaded_home",
    "quiet",
    "yaw_quaternion",
]
