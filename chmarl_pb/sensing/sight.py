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
from chmarl_pb.sensing.home_views import home_views
from chmarl_pb.sensing.movables import merge, movables
from chmarl_pb.world import Pose, World

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

    def picture(self, robot: str, pose: int, size: int) -> Picture:
        """Return what a robot's camera shows from a lattice pose, the rest of the world as it is now.

        Args:
            robot: "humanoid" or "drone".
            pose: lattice pose of that robot; where the camera is.
            size: width and height in pixels.

        Returns:
            The picture; its segmentation holds indices of ``names``, -1 for nothing.
        """
        home = self._views.look(robot, pose, size)
        poses = self._poses_in_view(robot, home.view)
        if not poses:
            return home.picture
        drawn = self._moving.draw(CAMERAS[robot], home.view, size, poses, self._configuration())
        return Picture(*merge(home.picture, drawn, self._first))

    def pixels(self, robot: str, pose: int) -> NDArray[np.int64]:
        """Return the number of pixels of each of ``names`` at ``SIGHT_SIZE``."""
        segmentation = self.picture(robot, pose, SIGHT_SIZE).segmentation
        return np.bincount(segmentation.ravel() + 1, minlength=len(self.names) + 1)[1:]

    def visible(self, robot: str, pose: int | None = None) -> tuple[str, ...]:
        """Return the names of the things that a robot sees, in the order of ``names``.

        Args:
            robot: "humanoid" or "drone".
            pose: look from this lattice pose instead of the present one.
        """
        counts = self.pixels(robot, self.world.robots[robot].pose if pose is None else pose)
        seen = (counts >= VISIBLE_PIXELS) & self._nodes
        seen[self.numbers[robot]] = False
        return tuple(self.names[number] for number in np.flatnonzero(seen))

    def _configuration(self) -> tuple[float, ...]:
        return Arm.carry if self.world.held else Arm.rest

    def _poses_in_view(self, robot: str, view: tuple[float, ...]) -> dict[str, Pose]:
        poses = {name: self.world.pose(name) for name in self.world.objects}
        poses |= {name: other.base_pose() for name, other in self.world.robots.items()}
        return {name: poses[name] for name in self._moving.in_view(CAMERAS[robot], view, poses)}


def _is_node(name: str) -> bool:
    return catalog.class_of(name) in catalog.CLASSES
