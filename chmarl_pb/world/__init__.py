"""The world: one PyBullet client with one home, its movable objects and their physics."""

from chmarl_pb.world.bodies import (
    UPRIGHT,
    Graspable,
    Pose,
    Vector,
    load_graspable,
    loaded_home,
    yaw_quaternion,
)
from chmarl_pb.world.bullet import quiet
from chmarl_pb.world.client import Client, Uncopied
from chmarl_pb.world.world import TIME_STEP, Support, World

__all__ = [
    "TIME_STEP",
    "UPRIGHT",
    "Client",
    "Graspable",
    "Pose",
    "Support",
    "Uncopied",
    "Vector",
    "World",
    "load_graspable",
    "loaded_home",
    "quiet",
    "yaw_quaternion",
]
