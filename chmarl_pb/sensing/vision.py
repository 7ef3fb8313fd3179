"""What one robot sees of one world: its picture, and the names of the things visible in it.

Visible means: at least ``VISIBLE_PIXELS`` pixels of its own in the segmentation of the robot's
camera at ``SIGHT_SIZE`` pixels, whatever picture the policy gets.
"""

from collections import OrderedDict
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
from chmarl_pb.world import Objects, World

SIGHT_SIZE = 128
VISIBLE_PIXELS = 4
_KEPT = 100_000  # pairs of poses of one home, 0.2 kB each

_ARRANGEMENTS = 1024  # of objects, the last ones

#: A robot, its pose, whether it holds something.
Stand = tuple[str, int, bool]
#: Robot, its pose, the robots that could be in view -> what it sees.
Seen = dict[tuple[str, int, tuple[Stand, ...]], tuple[str, ...]]
_seen: OrderedDict[int, tuple[Objects, Seen]] = OrderedDict()
#: Robot, its pose, another robot (or itself: its arm) -> whether something of that could be in view.
InView = dict[tuple[str, int, Stand], bool]
_in_view: WeakKeyDictionary[HomeViews, InView] = WeakKeyDictionary()  # shared by all who play in a home


def _seen_of(objects: Objects) -> Seen:
    """Return what has been seen of these very objects, in all worlds of this process: tasks are played repeatedly."""
    number = id(objects)  # nobody else's as long as they are kept
    _, seen = _seen.setdefault(number, (objects, {}))
    _seen.move_to_end(number)
    if len(_seen) > _ARRANGEMENTS:
        _seen.popitem(last=False)
    return seen


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
        self._objects: Objects | None = None  # those that the bodies and what follows are of
        self._numbers = np.zeros(0, np.int32)
        self._seen: Seen = {}
        self._in_view = _in_view.setdefault(self._views, {})
        self._canvas = clean_canvas(SIGHT_SIZE)

    def picture(self, robot: str, size: int) -> Picture:
        """Return what a robot's camera shows now.

        Args:
            robot: its name.
            size: width and height in pixels.

        Returns:
            The picture; its segmentation holds indices of ``names``, -1 for nothing.
        """
        home = self._views.look(robot, self.world.robots[robot].pose, size)
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
        pose = self.world.state.robots[robot].pose
        others = [stand for stand in self._others(robot) if self._may_show(robot, pose, stand)]
        key = (robot, pose, tuple(others))
        seen = self._seen.get(key)
        if seen is None:
            home = self._views.look(robot, pose, SIGHT_SIZE)
            seen = self._seen[key] = self._names(robot, home, self._with(others) if others else self._numbers)
        return seen

    def _names(self, robot: str, home: HomeView, present: NDArray[np.int32]) -> tuple[str, ...]:
        bodies = self._bodies
        seen = visibility.visible(
            present, self._first, VISIBLE_PIXELS, self._node_of[robot], bodies.models, bodies.placed, home.lens,
            home.shown, self._canvas, bodies.scratch,
        )  # fmt: skip
        return tuple([self.names[number] for number in seen.tolist()])

    def _others(self, robot: str) -> list[Stand]:
        """Return the robots that a robot might see: not its own body, but for an arm that carries something."""
        state = self.world.state
        stands = [(name, other.pose, name in state.grips) for name, other in state.robots.items()]
        return [stand for stand in stands if stand[0] != robot or stand[2]]

    def _may_show(self, robot: str, pose: int, other: Stand) -> bool:
        """Return whether something of another robot might be seen: it is not out of view or behind the home."""
        key = (robot, pose, other)
        shows = self._in_view.get(key)
        if shows is None:
            if len(self._in_view) == _KEPT:
                self._in_view.clear()
            name, _, holds = other
            (x, y, z), _ = self.world.state.robots[name].base
            height, radius = movables().balls[name, _arm(holds)]
            home = self._views.look(robot, pose, SIGHT_SIZE)
            ball = np.array((x, y, z + height, radius))
            shows = self._in_view[key] = bool(bounds.may_show(ball, home.lens, home.tiles, SIGHT_SIZE))
        return shows

    def _with(self, robots: Sequence[Stand]) -> NDArray[np.int32]:
        """Put robots where they are, and return the numbers of the objects and of these robots."""
        present = np.empty(len(self._numbers) + len(robots), np.int32)
        present[: len(self._numbers)] = self._numbers
        for place, (name, _, holds) in enumerate(robots, start=len(self._numbers)):
            self._bodies.put_robot(name, self.world.state.robots[name].base, _arm(holds))
            present[place] = self._body_numbers[name]
        return present

    def _present(self, robot: str) -> NDArray[np.int32]:
        """Put all that a robot could see where it is, and return its numbers."""
        self._update_objects()
        return self._with(self._others(robot))

    def _update_objects(self) -> None:
        """Put the objects where they are."""
        objects = self.world.state.objects
        if objects is not self._objects:
            self._bodies.put_objects(objects.poses)
            self._numbers = np.array([self._body_numbers[name] for name in self.world.objects], dtype=np.int32)
            self._seen = _seen_of(objects)
            self._objects = objects


def _arm(holds: bool) -> Configuration:
    return Arm.carry if holds else Arm.rest


def _is_node(name: str) -> bool:
    return catalog.class_of(name) in catalog.CLASSES
