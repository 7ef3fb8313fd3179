"""From which poses can a thing be seen? A cheap sure "no", before a picture gives the answer."""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.solids import Outlines, Points
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import FOOTPRINT, HEADINGS
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS
from chmarl_pb.robots.model import CameraMount, RobotModel

_WALL_HEIGHT = 2.2  # metres: a wall at least this high hides all that lies behind it from an eye below its top


class Outlook:
    """Which poses of a robot that drives may see a ball in which a thing lies; a refusal is always right."""

    def __init__(self, space: Space, model: RobotModel):
        """Collect the walls that are higher than the robot's camera."""
        self.lattice, self.camera = space.lattice_of(model.footprint), model.camera
        height = model.camera.position[2]
        self._walls = Outlines(
            [
                solid.polygon
                for thing in space.home.structure
                if thing.class_name == "wall"
                for solid in thing.solids
                if solid.top >= _WALL_HEIGHT > height and solid.bottom <= FOOTPRINT.low
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
        (forward, left, _), cosine, sine = self.camera.position, np.cos(yaw), np.sin(yaw)
        offset = forward * np.stack([cosine, sine], axis=1) + left * np.stack([-sine, cosine], axis=1)
        lenses = self.lattice.points[position] + offset
        seen = _shows(self.camera, lenses, yaw, centre, radius)
        seen[seen] = ~self._behind_wall(lenses[seen], centre[:2], radius)
        return seen

    def _behind_wall(self, lenses: Points, centre: Points, radius: float) -> NDArray[np.bool_]:
        """Return from which lenses one wall covers the whole ball: it crosses both outermost lines of sight."""
        away = centre - lenses
        distance = np.maximum(np.linalg.norm(away, axis=1, keepdims=True), 1e-9)
        ahead = away / distance
        front = centre - radius * ahead
        side = radius * np.stack([-ahead[:, 1], ahead[:, 0]], axis=1)
        hidden = (self._walls.crossed(lenses, front + side) & self._walls.crossed(lenses, front - side)).any(axis=1)
        behind: NDArray[np.bool_] = hidden & (distance[:, 0] > 2 * radius)
        return behind


def _shows(camera: CameraMount, lenses: Points, yaw: Points, centre: Points, radius: float) -> NDArray[np.bool_]:
    """Return from which lenses the ball touches a camera's cone of view and is not too far away to be visible."""
    offset = centre[:2] - lenses
    forward = np.cos(yaw) * offset[:, 0] + np.sin(yaw) * offset[:, 1]
    left = np.cos(yaw) * offset[:, 1] - np.sin(yaw) * offset[:, 0]
    up, sine, cosine = centre[2] - camera.position[2], np.sin(camera.pitch), np.cos(camera.pitch)
    depth = cosine * forward - sine * up
    height = sine * forward + cosine * up
    slope = np.tan(np.radians(camera.fov) / 2)
    allowance = radius * np.hypot(1, slope)
    inside = (depth > -radius) & (np.abs(left) <= depth * slope + allowance)
    touches = inside & (np.abs(height) <= depth * slope + allowance)
    beside = np.maximum(depth**2 - radius**2, 1e-9) * slope / (VISIBILITY_SIZE * radius * 1.01)
    wide, high = ((np.abs(depth) + np.abs(off)) / beside for off in (left, height))  # pixels, of what is ahead
    few = (np.floor(wide) + 1) * (np.floor(high) + 1) < VISIBLE_PIXELS
    shows: NDArray[np.bool_] = touches & ~(few & (depth > radius))
    return shows
