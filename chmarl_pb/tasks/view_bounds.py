"""From which poses can a thing be seen? A cheap sure "no", before a picture gives the answer."""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.solids import Outlines, Points
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import BODY, HEADINGS
from chmarl_pb.rendering.camera_poses import CAMERAS, HUMANOID_EYE, PITCH

_WALL_HEIGHT = 2.2  # metres: a wall at least this high hides all that lies behind it from the humanoid


class Outlook:
    """Which poses of the humanoid may see a ball in which a thing lies; a refusal is always right."""

    def __init__(self, space: Space):
        """Collect the home's walls."""
        self.lattice = space.lattice
        self._walls = Outlines(
            [
                solid.polygon
                for thing in space.home.structure
                if thing.class_name == "wall"
                for solid in thing.solids
                if solid.top >= _WALL_HEIGHT and solid.bottom <= BODY[0]
            ]
        )

    def may_see(self, poses: NDArray[np.int64], centre: Points, radius: float) -> NDArray[np.bool_]:
        """Return which poses (n,) may see something of a ball.

        Args:
            poses: poses on the lattice.
            centre: of the ball (3,), metres.
            radius: of the ball, metres.
        """
        position, heading = np.divmod(poses, HEADINGS)
        yaw = 2 * np.pi * heading / HEADINGS
        eyes = self.lattice.points[position] + HUMANOID_EYE[0] * np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        seen = _in_cone(eyes, yaw, centre, radius)
        seen[seen] = ~self._behind_wall(eyes[seen], centre[:2], radius)
        return seen

    def _behind_wall(self, eyes: Points, centre: Points, radius: float) -> NDArray[np.bool_]:
        """Return from which eyes one wall covers the whole ball: it crosses both outermost lines of sight."""
        away = centre - eyes
        distance = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        ahead = away / distance
        front = centre - radius * ahead
        side = radius * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        hidden = (self._walls.crossed(eyes, front + side) & self._walls.crossed(eyes, front - side)).any(axis=1)
        behind: NDArray[np.bool_] = hidden & (distance[:, 0] > 2 * radius)
        return behind


def _in_cone(eyes: Points, yaw: Points, centre: Points, radius: float) -> NDArray[np.bool_]:
    """Return from which eyes the ball touches the humanoid camera's cone of view."""
    offset = centre[:2] - eyes
    forward = np.cos(yaw) * offset[:, 0] + np.sin(yaw) * offset[:, 1]
    left = np.cos(yaw) * offset[:, 1] - np.sin(yaw) * offset[:, 0]
    up = centre[2] - HUMANOID_EYE[2]
    depth = np.cos(PITCH) * forward - np.sin(PITCH) * up
    height = np.sin(PITCH) * forward + np.cos(PITCH) * up
    slope = np.tan(np.radians(CAMERAS["humanoid"].fov) / 2)
    allowance = radius * np.hypot(1, slope)
    inside = (depth > -radius) & (np.abs(left) <= depth * slope + allowance)
    touches: NDArray[np.bool_] = inside & (np.abs(height) <= depth * slope + allowance)
    return touches
