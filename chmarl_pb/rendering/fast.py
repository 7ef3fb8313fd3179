"""The fast renderer: the home is drawn once for each camera pose and kept; a step draws only what moves into it.

It gives the pictures of :mod:`chmarl_pb.rendering.tiny` bit by bit.
"""

from collections import OrderedDict
from collections.abc import Sequence
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.rendering import bounds
from chmarl_pb.rendering import visible_pixels as visibility
from chmarl_pb.rendering.camera import Picture
from chmarl_pb.rendering.home_views import HomeView, HomeViews, home_views
from chmarl_pb.rendering.movables import Bodies, draw_over, image_over, movables
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS, can_be_visible, renderer_names
from chmarl_pb.rendering.triangles import clean_canvas
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.world import Objects, World

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


class FastRenderer:
    """Draws what the robots of one world see; see :class:`chmarl_pb.rendering.renderer.Renderer`."""

    def __init__(self, world: World):
        """Share the process's views of the home and models of what moves."""
        self._world = world
        self._views = home_views(world.home)
        self._bodies = Bodies()
        self._body_numbers = movables().numbers
        self.names = renderer_names(world)
        self._first = len(world.links)
        self._counts = {robot: can_be_visible(self.names, robot) for robot in world.robots}
        self._objects: Objects | None = None  # those that the bodies and what follows are of
        self._numbers = np.zeros(0, np.int32)
        self._seen: Seen = {}
        self._in_view = _in_view.setdefault(self._views, {})
        self._canvas = clean_canvas(VISIBILITY_SIZE)

    def picture(self, robot: str, size: int) -> Picture:
        """Return what a robot's camera shows."""
        return draw_over(self._empty(robot, size), self._bodies, self._present(robot), self._first)

    def image(self, robot: str, size: int) -> NDArray[np.uint8]:
        """Return the colours of what a robot's camera shows."""
        return image_over(self._empty(robot, size), self._bodies, self._present(robot))

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees."""
        self._update_objects()
        pose = self._world.state.robots[robot].pose
        others = [stand for stand in self._others(robot) if self._may_show(robot, pose, stand)]
        key = (robot, pose, tuple(others))
        seen = self._seen.get(key)
        if seen is None:
            home = self._empty(robot, VISIBILITY_SIZE)
            seen = self._seen[key] = self._names(robot, home, self._with(others) if others else self._numbers)
        return seen

    def pixels(self, robot: str) -> NDArray[np.int64]:
        """Return the number of pixels of each of ``names`` in a robot's picture of ``VISIBILITY_SIZE``."""
        home, bodies = self._empty(robot, VISIBILITY_SIZE), self._bodies
        pixels = np.zeros(len(self.names), dtype=np.int64)
        visibility.count(
            self._present(robot), self._first, VISIBILITY_SIZE**2, bodies.models, bodies.placed, home.lens, home.shown,
            self._canvas, bodies.scratch, pixels,
        )  # fmt: skip
        return pixels

    def _names(self, robot: str, home: HomeView, present: NDArray[np.int32]) -> tuple[str, ...]:
        bodies = self._bodies
        seen = visibility.visible(
            present, self._first, VISIBLE_PIXELS, self._counts[robot], bodies.models, bodies.placed, home.lens,
            home.shown, self._canvas, bodies.scratch,
        )  # fmt: skip
        return tuple([self.names[number] for number in seen.tolist()])

    def _empty(self, robot: str, size: int) -> HomeView:
        """Return the empty home as a robot's camera sees it."""
        return self._views.look(robot, self._world.state.robots[robot].pose, size)

    def _others(self, robot: str) -> list[Stand]:
        """Return the robots that a robot might see: not its own body, but for an arm that carries something."""
        state = self._world.state
        grips = state.grips
        return [
            (name, other.pose, name in grips) for name, other in state.robots.items() if name != robot or name in grips
        ]

    def _may_show(self, robot: str, pose: int, other: Stand) -> bool:
        """Return whether something of another robot might be seen: it is not out of view or behind the home."""
        key = (robot, pose, other)
        shows = self._in_view.get(key)
        if shows is None:
            if len(self._in_view) == _KEPT:
                self._in_view.clear()
            name, _, holds = other
            (x, y, z), _ = self._world.state.robots[name].base
            height, radius = movables().balls[name, _arm(holds)]
            home = self._empty(robot, VISIBILITY_SIZE)
            ball = np.array((x, y, z + height, radius))
            shows = self._in_view[key] = bool(bounds.may_show(ball, home.lens, home.tiles, VISIBILITY_SIZE))
        return shows

    def _with(self, robots: Sequence[Stand]) -> NDArray[np.int32]:
        """Put robots where they are, and return the numbers of the objects and of these robots."""
        present = np.empty(len(self._numbers) + len(robots), np.int32)
        present[: len(self._numbers)] = self._numbers
        for place, (name, _, holds) in enumerate(robots, start=len(self._numbers)):
            self._bodies.put_robot(name, self._world.state.robots[name].base, _arm(holds))
            present[place] = self._body_numbers[name]
        return present

    def _present(self, robot: str) -> NDArray[np.int32]:
        """Put all that a robot could see where it is, and return its numbers."""
        self._update_objects()
        return self._with(self._others(robot))

    def _update_objects(self) -> None:
        """Put the objects where they are."""
        objects = self._world.state.objects
        if objects is not self._objects:
            self._bodies.put_objects(objects.poses)
            self._numbers = np.array([self._body_numbers[name] for name in self._world.objects], dtype=np.int32)
            self._seen = _seen_of(objects)
            self._objects = objects


def _seen_of(objects: Objects) -> Seen:
    """Return what has been seen of these very objects, in all worlds of this process: tasks are played repeatedly."""
    number = id(objects)  # nobody else's as long as they are kept
    _, seen = _seen.setdefault(number, (objects, {}))
    _seen.move_to_end(number)
    if len(_seen) > _ARRANGEMENTS:
        _seen.popitem(last=False)
    return seen


def _arm(holds: bool) -> Configuration:
    return Arm.carry if holds else Arm.rest
