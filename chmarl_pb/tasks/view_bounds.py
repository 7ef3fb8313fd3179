"""From which poses can a thing be seen? A cheap sure "no", before a picture gives the answer."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.homes.solids import Outlines, Points, crosses
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import FOOTPRINT, HEADINGS
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS
from chmarl_pb.robots.model import RobotModel

_WALL_HEIGHT = 2.2  # metres: a wall at least this high hides all that lies behind it from an eye below its top


class Cone(NamedTuple):
    """What a camera sees at most, seen from its robot's base.

    Attributes:
        height: of the lens above the floor, metres.
        sine: of the pitch.
        cosine: of the pitch.
        slope: of the picture's edges.
    """

    height: float
    sine: float
    cosine: float
    slope: float


class Outlook:
    """Which poses of a robot that drives may see a ball in which a thing lies; a refusal is always right."""

    def __init__(self, space: Space, model: RobotModel):
        """Collect the walls that are higher than the robot's camera."""
        self.lattice, camera = space.lattice_of(model.footprint), model.camera
        (forward, left, height), yaw = camera.position, 2 * np.pi * np.arange(HEADINGS) / HEADINGS
        slope = float(np.tan(np.radians(camera.fov) / 2))
        self._cone = Cone(height, float(np.sin(camera.pitch)), float(np.cos(camera.pitch)), slope)
        self._ahead = np.stack([np.cos(yaw), np.sin(yaw)], axis=1)
        self._lenses = forward * self._ahead + left * self._ahead[:, ::-1] * (-1, 1)  # from the base, by heading
        self._walls = Outlines(
            [
                solid.polygon
                for thing in space.home.structure
                if thing.class_name == "wall"
                for solid in thing.solids
                if solid.top >= _WALL_HEIGHT > height and solid.bottom <= FOOTPRINT.low
            ]
        )

    def may_see(self, poses: NDArray[np.int64], balls: Points) -> NDArray[np.bool_]:
        """Return which poses (n,) may see something of one of some balls.

        Args:
            poses: poses on the lattice.
            balls: (m, 4) their centres and radii, metres.
        """
        seen = np.zeros(len(poses), np.bool_)
        _find_seen(poses, balls, self.lattice.points, self._ahead, self._lenses, self._cone, self._walls.sides, seen)
        return seen


@compiled
def _find_seen(poses, balls, points, ahead, lenses, cone, walls, seen):  # type: ignore[no-untyped-def]
    """Set ``seen`` (n,): whether a pose may see something of one of the balls."""
    for row in range(len(poses)):
        place, heading = poses[row] // HEADINGS, poses[row] % HEADINGS
        x, y = points[place, 0] + lenses[heading, 0], points[place, 1] + lenses[heading, 1]
        for ball in balls:
            right, up, radius = ball[0] - x, ball[1] - y, ball[3]
            forward = ahead[heading, 0] * right + ahead[heading, 1] * up
            left = ahead[heading, 0] * up - ahead[heading, 1] * right
            if _shows(cone, forward, left, ball[2] - cone.height, radius) and not _is_behind_wall(
                walls, x, y, right, up, radius
            ):
                seen[row] = True
                break


@compiled
def _shows(cone, forward, left, up, radius):  # type: ignore[no-untyped-def]
    """Return whether a ball touches the cone of view, and is not too far away to be visible."""
    depth = cone.cosine * forward - cone.sine * up
    height = cone.sine * forward + cone.cosine * up
    most = depth * cone.slope + radius * np.hypot(1.0, cone.slope)
    if depth <= -radius or abs(left) > most or abs(height) > most:
        return False
    if depth <= radius:
        return True
    beside = max(depth**2 - radius**2, 1e-9) * cone.slope / (VISIBILITY_SIZE * radius * 1.01)
    wide, high = (depth + abs(left)) / beside, (depth + abs(height)) / beside  # pixels
    return (np.floor(wide) + 1) * (np.floor(high) + 1) >= VISIBLE_PIXELS


@compiled
def _is_behind_wall(walls, x, y, right, up, radius):  # type: ignore[no-untyped-def]
    """Return whether one wall covers a whole ball: it crosses both outermost lines of sight."""
    distance = max(np.hypot(right, up), 1e-9)
    if distance <= 2 * radius:
        return False
    right, up = right / distance, up / distance
    front_x, front_y = x + right * (distance - radius), y + up * (distance - radius)
    across, along = -up * radius, right * radius
    for wall in range(len(walls.offsets)):
        if crosses(walls, wall, x, y, front_x + across, front_y + along) and crosses(
            walls, wall, x, y, front_x - across, front_y - along
        ):
            return True
    return False
