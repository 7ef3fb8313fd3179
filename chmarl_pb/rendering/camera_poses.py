"""Where each robot's camera is: fixed to its lattice pose, so that the set of views is finite."""

import numpy as np

from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import DRONE_HEADING, DRONE_HEIGHT
from chmarl_pb.rendering.camera import Camera
from chmarl_pb.world import Pose

CAMERAS = {"humanoid": Camera(fov=90.0), "drone": Camera(fov=75.0)}

HUMANOID_EYE = (0.12, 0.0, 1.5)  # metres in the base frame: link "camera" of humanoid.urdf at rest
PITCH = np.radians(20)  # the humanoid's camera looks down by this much
DRONE_EYE = -0.075  # metres from the drone's origin to its lens: link "camera" of drone.urdf


def eye(space: Space, robot: str, pose: int) -> Pose:
    """Return the camera's pose in the world for a robot's lattice pose."""
    if robot == "drone":
        x, y = space.drone_lattice.points[pose]
        return (float(x), float(y), DRONE_HEIGHT + DRONE_EYE), looking(DRONE_HEADING, np.pi / 2)
    x, y, yaw = space.lattice.pose(pose)
    forward, _, height = HUMANOID_EYE
    position = (x + forward * float(np.cos(yaw)), y + forward * float(np.sin(yaw)), height)
    return position, looking(yaw, PITCH)


def looking(yaw: float, pitch: float) -> tuple[float, float, float, float]:
    """Return the orientation (x, y, z, w) of a camera turned by a yaw and then down by a pitch, radians."""
    cy, sy, cp, sp = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return float(-sy * sp), float(cy * sp), float(sy * cp), float(cy * cp)
