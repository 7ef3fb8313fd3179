"""What one robot sees of one world: its picture, and the names of the things visible in it.

Visible means: at least ``VISIBLE_PIXELS`` pixels of its own in the segmentation of the robot's
camera at ``SIGHT_SIZE`` pixels, whatever picture the policy gets.
"""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.robots.arm import Arm
from chmarl_pb.sensing.camera import Picture
from chmarl_pb.sensing.eyes import CAMERAS
from chmarl_pb.sensing.home_views import HomeView, count_pixels, home_views
from chmarl_pb.sensing.movables import merge, movables
from chmarl_pb.world import Pose, Vector, World

SIGHT_SIZE = 128
VISIBLE_PIXELS = 4


class Sight:
    """The eyes of all robots of one world.

    Attributes:
        names: every name that can be visible: the home's links, then objects, then robots.
    """

    def __init__(self, world: World):
        """Prepare to look at a world."""
        self.world = world
        self._views = home_views(world.home)
        self._moving = movables()
        self.names = tuple(world.links) + self._moving.names
        self._first = len(world.links)
        self.numbers = {name: number for number, name in enumerate(self.names)}
        self._nodes = np.array([_is_node(name) for name in self.names])
        self._drawn: dict[tuple[str, int], tuple[tuple[object, ...], Picture]] = {}

    def picture(self, robot: str, pose: int, size: int) -> Picture:
        """Return what a robot's camera shows.

        Args:
            robot: "humanoid" or "drone".
            pose: its pose on its lattice, where the robot must be now.
            size: width and height in pixels.

        Returns:
            The picture; its segmentation holds indices of ``names``, -1 for nothing.
        """
        home = self._views.look(robot, pose, size)
        moving = self._moving_in(robot, pose, home, size)
        return home.picture if moving is None else merge(home.picture, moving, self._first)

    def pixels(self, robot: str) -> NDArray[np.int64]:
        """Return the number of pixels of each of ``names`` in a robot's view at ``SIGHT_SIZE``."""
        pose = self.world.robots[robot].pose
        home = self._views.look(robot, pose, SIGHT_SIZE)
        counts = np.zeros(len(self.names), dtype=np.int64)
        counts[: len(home.pixels)] = home.pixels
        moving = self._moving_in(robot, pose, home, SIGHT_SIZE)
        if moving is not None:
            nearer = moving.depth < home.picture.depth
            counts[: self._first] -= count_pixels(home.picture.segmentation[nearer], self._first)
            counts[self._first :] += count_pixels(moving.segmentation[nearer], len(counts) - self._first)
        return counts

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees, in the order of ``names``."""
        seen = (self.pixels(robot) >= VISIBLE_PIXELS) & self._nodes
        seen[self.numbers[robot]] = False
        return tuple(self.names[number] for number in np.flatnonzero(seen))

    def _moving_in(self, robot: str, pose: int, home: HomeView, size: int) -> Picture | None:
        """Return the picture of the moving bodies alone, or None if none is in view.

        The last picture of each robot and size is kept: pictures and visibility share it.
        """
        configuration = Arm.carry if self.world.held else Arm.rest
        poses = self._poses_in_view(robot, home.view)
        if not poses:
            return None
        key = (pose, poses, configuration)
        kept = self._drawn.get((robot, size))
        if kept is None or kept[0] != key:
            drawn = self._moving.draw(CAMERAS[robot], home.view, size, poses, configuration)
            self._drawn[robot, size] = kept = (key, drawn)
        return kept[1]

    def _poses_in_view(self, robot: str, view: Vector) -> dict[str, Pose]:
        poses = {name: self.world.pose(name) for name in self.world.objects}
        for name, other in self.world.robots.items():
            # Its own body is out of a robot's sight, but for the humanoid's arm when it carries something.
            if name != robot or self.world.held is not None:
                poses[name] = other.base_pose()
        return {name: poses[name] for name in self._moving.in_view(CAMERAS[robot], view, poses)}


def _is_node(name: str) -> bool:
    return catalog.class_of(name) in catalog.CLASSES
