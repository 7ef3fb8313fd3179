"""What one robot sees of one world: its picture, and the names of the things visible in it.

Visible means: at least ``VISIBLE_PIXELS`` pixels of its own in the segmentation of the robot's
camera at ``SIGHT_SIZE`` pixels, whatever picture the policy gets.
"""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.robots.arm import Arm
from chmarl_pb.sensing import raster
from chmarl_pb.sensing.camera import Picture
from chmarl_pb.sensing.eyes import CAMERAS
from chmarl_pb.sensing.home_views import HomeView, home_views
from chmarl_pb.sensing.movables import Bodies, colours_over, draw_over, movables
from chmarl_pb.sensing.triangles import clean_canvas
from chmarl_pb.world import World

SIGHT_SIZE = 128
VISIBLE_PIXELS = 4


class Sight:
    """The eyes of all robots of one world.

    Attributes:
        names: every name that can be visible: the home's links, then objects, then robots.
        numbers: name -> its place in ``names``.
    """

    def __init__(self, world: World):
        """Prepare to look at a world."""
        self.world = world
        self._views = home_views(world.home)
        self._bodies = Bodies()
        self._body_numbers = movables().numbers
        self.names = tuple(world.links) + tuple(self._body_numbers)
        self._first = len(world.links)
        self.numbers = {name: number for number, name in enumerate(self.names)}
        nodes = np.array([_is_node(name) for name in self.names])
        # A robot does not see itself.
        self._node_of = {robot: nodes & (np.array(self.names) != robot) for robot in CAMERAS}
        self._version = -1
        self._robots_of: dict[str, list[int]] = {}  # those that a robot might see
        self._present: dict[str, NDArray[np.int32]] = {}  # all bodies that it might see
        self._seen: dict[tuple[str, int], tuple[str, ...]] = {}  # from a pose, when no robot could be in view
        self._stances: dict[str, tuple[int, bool]] = {}
        self._canvas = clean_canvas(SIGHT_SIZE)

    def picture(self, robot: str, pose: int, size: int) -> Picture:
        """Return what a robot's camera shows.

        Args:
            robot: "humanoid" or "drone".
            pose: its pose on its lattice, where the robot must be now.
            size: width and height in pixels.

        Returns:
            The picture; its segmentation holds indices of ``names``, -1 for nothing.
        """
        self._update()
        home = self._views.look(robot, pose, size)
        return draw_over(home, self._bodies, self._present[robot], self._first)

    def colours(self, robot: str, size: int) -> NDArray[np.uint8]:
        """Return the colours (size, size, 3) of what a robot's camera shows now."""
        self._update()
        home = self._views.look(robot, self.world.robots[robot].pose, size)
        return colours_over(home, self._bodies, self._present[robot])

    def pixels(self, robot: str) -> NDArray[np.int64]:
        """Return the number of pixels of each of ``names`` in a robot's view at ``SIGHT_SIZE``."""
        self._update()
        return self._pixels(robot, self._views.look(robot, self.world.robots[robot].pose, SIGHT_SIZE))

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees, in the order of ``names``."""
        self._update()
        key = robot, self.world.robots[robot].pose
        home, balls = self._views.look(*key, SIGHT_SIZE), self._bodies.placed.balls
        for body in self._robots_of[robot]:
            if raster.may_show(body, balls, home.lens, home.tiles, SIGHT_SIZE):
                return self._names(robot, home)
        if key not in self._seen:
            self._seen[key] = self._names(robot, home)
        return self._seen[key]

    def _names(self, robot: str, home: HomeView) -> tuple[str, ...]:
        seen = (self._pixels(robot, home) >= VISIBLE_PIXELS) & self._node_of[robot]
        return tuple([self.names[number] for number in seen.nonzero()[0].tolist()])

    def _pixels(self, robot: str, home: HomeView) -> NDArray[np.int64]:
        pixels = np.zeros(len(self.names), dtype=np.int64)
        pixels[: len(home.pixels)] = home.pixels
        bodies, picture = self._bodies, home.picture
        raster.count(
            self._present[robot], self._first, bodies.models, bodies.placed, home.lens, picture.depth, home.tiles,
            picture.segmentation, self._canvas, bodies.scratch, pixels,
        )  # fmt: skip
        return pixels

    def _update(self) -> None:
        """Bring the bodies up to date."""
        world = self.world
        if world.version != self._version:
            self._bodies.put_objects({name: world.pose(name) for name in world.objects})
            objects = [self._body_numbers[name] for name in world.objects]
            for robot in world.robots:
                # Its own body is out of a robot's sight, but for the humanoid's arm when it carries something.
                robots = [name for name in world.robots if name != robot or world.held is not None]
                self._robots_of[robot] = [self._body_numbers[name] for name in robots]
                self._present[robot] = np.array(objects + self._robots_of[robot], dtype=np.int32)
            self._seen.clear()
            self._version = world.version
        for name, other in world.robots.items():
            stance = other.pose, world.held is not None
            if self._stances.get(name) != stance:
                self._bodies.put_robot(name, other.base_pose(), Arm.carry if world.held else Arm.rest)
                self._stances[name] = stance


def _is_node(name: str) -> bool:
    return catalog.class_of(name) in catalog.CLASSES
