"""What one robot sees of one world: its picture, and the names of the things visible in it.

Visible means: at least ``VISIBLE_PIXELS`` pixels of its own in the segmentation of the robot's
camera at ``SIGHT_SIZE`` pixels, whatever picture the policy gets.
"""

from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.rendering import bounds
from chmarl_pb.rendering import visible_pixels as visibility
from chmarl_pb.rendering.camera import Picture
from chmarl_pb.rendering.camera_poses import CAMERAS
from chmarl_pb.rendering.home_views import HomeView, HomeViews, home_views
from chmarl_pb.rendering.movables import Bodies, colours_over, draw_over, movables
from chmarl_pb.rendering.triangles import clean_canvas
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.world import World

SIGHT_SIZE = 128
VISIBLE_PIXELS = 4
_KEPT = 100_000  # views of layouts, 0.4 kB each; pairs of poses of one home, 0.2 kB each

#: Layout or None, robot, its pose, the robots that could be in view with their poses -> what it sees.
Seen = dict[tuple[object, str, int, tuple[tuple[str, int], ...]], tuple[str, ...]]
_seen_in_layouts: Seen = {}  # by all worlds of this process

#: Robot, pose of the humanoid, pose of the drone, whether something is held -> the robots that could be in view.
InView = dict[tuple[str, int, int, bool], tuple[str, ...]]
_robots_in_view: WeakKeyDictionary[HomeViews, InView] = WeakKeyDictionary()  # shared by all who play in a home


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
        self._objects = np.zeros(0, np.int32)  # those present
        self._seen_since: Seen = {}  # since the last change of the objects
        self._robots_in_view = _robots_in_view.setdefault(self._views, {})
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
        home = self._views.look(robot, pose, size)
        return draw_over(home, self._bodies, self._present(robot), self._first)

    def colours(self, robot: str, size: int) -> NDArray[np.uint8]:
        """Return the colours (size, size, 3) of what a robot's camera shows now."""
        home = self._views.look(robot, self.world.robots[robot].pose, size)
        return colours_over(home, self._bodies, self._present(robot))

    def pixels(self, robot: str) -> NDArray[np.int64]:
        """Return the number of pixels of each of ``names`` in a robot's view at ``SIGHT_SIZE``."""
        home, bodies = self._views.look(robot, self.world.robots[robot].pose, SIGHT_SIZE), self._bodies
        pixels = np.zeros(len(self.names), dtype=np.int64)
        visibility.count(
            self._present(robot), self._first, SIGHT_SIZE**2, bodies.models, bodies.placed, home.lens, home.shown,
            self._canvas, bodies.scratch, pixels,
        )  # fmt: skip
        return pixels

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees, in the order of ``names``."""
        self._update_objects()
        world, pose, robots = self.world, self.world.robots[robot].pose, self._in_view(robot)
        key = (world.layout, robot, pose, tuple([(name, world.robots[name].pose) for name in robots]))
        kept = self._seen_since if world.layout is None else _seen_in_layouts
        seen = kept.get(key)
        if seen is None:
            if len(kept) == _KEPT:
                kept.clear()
            home = self._views.look(robot, pose, SIGHT_SIZE)
            seen = kept[key] = self._names(robot, home, self._with(robots) if robots else self._objects)
        return seen

    def _names(self, robot: str, home: HomeView, present: NDArray[np.int32]) -> tuple[str, ...]:
        bodies = self._bodies
        seen = visibility.visible(
            present, self._first, VISIBLE_PIXELS, self._node_of[robot], bodies.models, bodies.placed, home.lens,
            home.shown, self._canvas, bodies.scratch,
        )  # fmt: skip
        return tuple([self.names[number] for number in seen.tolist()])

    def _others(self, robot: str) -> list[str]:
        """Return the robots that a robot might see: not its own body, but for an arm that carries something."""
        return [name for name in self.world.robots if name != robot or (name == "humanoid" and self.world.held)]

    def _in_view(self, robot: str) -> tuple[str, ...]:
        """Return the robots of which a robot might see something: the others are out of view or behind the home."""
        robots = self.world.robots
        key = (robot, robots["humanoid"].pose, robots["drone"].pose, self.world.held is not None)
        names = self._robots_in_view.get(key)
        if names is None:
            if len(self._robots_in_view) == _KEPT:
                self._robots_in_view.clear()
            home = self._views.look(robot, robots[robot].pose, SIGHT_SIZE)
            names = tuple([name for name in self._others(robot) if self._may_show(name, home)])
            self._robots_in_view[key] = names
        return names

    def _may_show(self, robot: str, home: HomeView) -> bool:
        (x, y, z), _ = self.world.robots[robot].base_pose()
        height, radius = movables().balls[robot, self._arm]
        return bounds.may_show(np.array((x, y, z + height, radius)), home.lens, home.tiles, SIGHT_SIZE)

    def _with(self, robots: Sequence[str]) -> NDArray[np.int32]:
        """Put robots where they are, and return the numbers of the objects and of these robots."""
        present = np.empty(len(self._objects) + len(robots), np.int32)
        present[: len(self._objects)] = self._objects
        for place, name in enumerate(robots, start=len(self._objects)):
            self._bodies.put_robot(name, self.world.robots[name].base_pose(), self._arm)
            present[place] = self._body_numbers[name]
        return present

    def _present(self, robot: str) -> NDArray[np.int32]:
        """Put all that a robot could see where it is, and return its numbers."""
        self._update_objects()
        return self._with(self._others(robot))

    @property
    def _arm(self) -> Configuration:
        return Arm.carry if self.world.held else Arm.rest

    def _update_objects(self) -> None:
        """Put the objects where they are."""
        world = self.world
        if world.version != self._version:
            objects = world.objects
            self._bodies.put_objects({name: world.pose(name) for name in objects})
            self._objects = np.array([self._body_numbers[name] for name in objects], dtype=np.int32)
            self._seen_since.clear()
            self._version = world.version


def _is_node(name: str) -> bool:
    return catalog.class_of(name) in catalog.CLASSES
