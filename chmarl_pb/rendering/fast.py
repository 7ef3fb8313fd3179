"""The fast renderer: the home is drawn once for each camera pose and kept; a step draws only what moves into it.

It gives the pictures of :mod:`chmarl_pb.rendering.tiny` bit by bit, but for rare ties of depth (docs/architecture.md).
"""

from collections import OrderedDict
from collections.abc import Mapping, Sequence
from functools import cache, lru_cache
from itertools import count
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.rendering import bounds
from chmarl_pb.rendering import visible_pixels as visibility
from chmarl_pb.rendering.bounds import Sight
from chmarl_pb.rendering.camera import Picture, camera_of, empty_picture, lens, view_matrix
from chmarl_pb.rendering.canvas import canvas
from chmarl_pb.rendering.home_views import HomeView, HomeViews, home_views
from chmarl_pb.rendering.movables import Bodies, Joints, Movables, Team, draw_over, image_over, movables, team_in
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS, can_be_visible, renderer_names
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import Objects, RobotState, World, yaw_quaternion

_KEPT = 100_000  # pairs of poses of one home, 0.2 kB each
_ARRANGEMENTS = 1024  # of objects, the last ones
_STATES = 8192  # of robots, 0.7 kB each
_IMAGE_BYTES = 2**23  # of the pictures of one world: at 128 pixels those of some episodes

#: A robot, its pose, the number of its posture: positions of joints are slow to compare.
Stand = tuple[str, int, int]
_postures = count()
#: Robot, its pose, the robots that could be in view -> what it sees.
Seen = dict[tuple[str, int, tuple[Stand, ...]], tuple[str, ...]]
_seen: OrderedDict[tuple[int, Team], tuple[Objects, Seen]] = OrderedDict()
#: Robot, its pose, another robot (or itself: its arm), size of the picture -> whether that could be in view.
InView = dict[tuple[str, int, Stand, int], bool]
_in_view: WeakKeyDictionary[HomeViews, dict[Team, InView]] = WeakKeyDictionary()  # shared by all who play in a home
#: A robot, positions of its joints -> whether its camera shows its own body.
_themselves: WeakKeyDictionary[Movables, dict[tuple[str, Joints], bool]] = WeakKeyDictionary()


class FastRenderer:
    """Draws what the robots of one world see; see :class:`chmarl_pb.rendering.renderer.Renderer`."""

    def __init__(self, world: World, robots: Mapping[str, RobotModel]):
        """Share the process's views of the home and models of what moves."""
        self._world, self._models = world, robots
        self._views = home_views(world.home)
        known = world.home.catalog
        self._team = team_in(world, robots)
        self._movables = movables(self._team, known)
        self._bodies = Bodies(self._movables)
        self._body_numbers = self._movables.numbers
        self.names = renderer_names(world)
        self._first = len(world.links)
        self._counts = {robot: can_be_visible(self.names, robots, robot, known) for robot in robots}
        self._objects: Objects | None = None  # those that the bodies and what follows are of
        self._numbers = np.zeros(0, np.int32)
        self._seen: Seen = {}
        self._images: dict[tuple[str, int, int, tuple[Stand, ...]], NDArray[np.uint8]] = {}  # of these very objects
        self._image_bytes = 0
        self._in_view = _in_view.setdefault(self._views, {}).setdefault(self._team, {})
        self._canvas = canvas(VISIBILITY_SIZE).words
        self._stands: dict[int, tuple[RobotState, Stand, bool]] = {}  # by the identity of the state

    def picture(self, robot: str, size: int) -> Picture:
        """Return what a robot's camera shows."""
        return draw_over(self._empty(robot, size, colours=True), self._bodies, self._present(robot), self._first)

    def image(self, robot: str, size: int) -> NDArray[np.uint8]:
        """Return the colours of what a robot's camera shows."""
        self._update_objects()
        pose = self._world.state.robots[robot].pose
        others = self._in_sight(robot, pose, size, colours=True)
        key = (robot, pose, size, tuple(others))
        image = self._images.get(key)
        if image is None:
            image = image_over(self._empty(robot, size, colours=True), self._bodies, self._with(others))
            self._image_bytes += image.nbytes
            if self._image_bytes > _IMAGE_BYTES:
                self._forget_images()
            self._images[key] = image
        return image.copy()

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees."""
        self._update_objects()
        pose = self._world.state.robots[robot].pose
        others = self._in_sight(robot, pose, VISIBILITY_SIZE)
        key = (robot, pose, tuple(others))
        seen = self._seen.get(key)
        if seen is None:
            if len(self._seen) == _KEPT:
                self._seen.clear()
            home = self._empty(robot, VISIBILITY_SIZE)
            seen = self._seen[key] = self._names(robot, home, self._with(others))
        return seen

    def could_see(self, robot: str, item: str) -> bool:
        """Return whether a robot would see an object if nothing hid it, for which no view of the home is needed."""
        self._update_objects()
        model, present = self._models[robot], np.array([self._body_numbers[item]], np.int32)
        eye = model.eye(self._views.space, self._world.state.robots[robot].pose)
        empty, tiles = _nothing()
        sight = Sight(lens(camera_of(model), view_matrix(eye)), empty.depth, tiles)
        seen = visibility.visible(
            present, self._first, VISIBLE_PIXELS, self._counts[robot], self._bodies.stage.words, sight.words,
            empty.segmentation, np.zeros(0, np.int64), self._canvas,
        )  # fmt: skip
        return len(seen) > 0

    def pixels(self, robot: str) -> NDArray[np.int64]:
        """Return the number of pixels of each of ``names`` in a robot's picture of ``VISIBILITY_SIZE``."""
        home = self._empty(robot, VISIBILITY_SIZE)
        pixels = np.zeros(len(self.names), dtype=np.int64)
        visibility.count(
            self._present(robot), self._first, VISIBILITY_SIZE**2, self._bodies.stage.words, home.sight.words,
            home.picture.segmentation, home.pixels, self._canvas, pixels,
        )  # fmt: skip
        return pixels

    def _names(self, robot: str, home: HomeView, present: NDArray[np.int32]) -> tuple[str, ...]:
        seen = visibility.visible(
            present, self._first, VISIBLE_PIXELS, self._counts[robot], self._bodies.stage.words, home.sight.words,
            home.picture.segmentation, home.pixels, self._canvas,
        )  # fmt: skip
        return tuple([self.names[number] for number in seen.tolist()])

    def _empty(self, robot: str, size: int, colours: bool = False) -> HomeView:
        """Return the empty home as a robot's camera sees it."""
        return self._views.look(self._models[robot], self._world.state.robots[robot].pose, size, self._world, colours)

    def _others(self, robot: str) -> list[Stand]:
        """Return the robots that a robot might see: of its own body only what it holds before its camera."""
        found = []
        for name, state in self._world.state.robots.items():
            known = self._stands.get(id(state))
            if known is None or known[0] is not state:
                known = self._stands[id(state)] = self._stand_of(name, state)
            if name != robot or known[2]:
                found.append(known[1])
        return found

    def _stand_of(self, name: str, state: RobotState) -> tuple[RobotState, Stand, bool]:
        """Return a robot's stand, and whether its camera shows its own body; the state is kept for its id."""
        if len(self._stands) == _STATES:
            self._stands.clear()
        themselves = _themselves.setdefault(self._movables, {})
        key = name, state.joints
        if key not in themselves:
            if len(themselves) == _STATES:
                themselves.clear()
            themselves[key] = _sees_itself(self._movables, self._models[name], *key)
        return state, (name, state.pose, _posture(state.joints)), themselves[key]

    def _in_sight(self, robot: str, pose: int, size: int, colours: bool = False) -> list[Stand]:
        """Return the robots of which something might be seen in a picture of a size."""
        return [stand for stand in self._others(robot) if self._may_show(robot, pose, stand, size, colours)]

    def _may_show(self, robot: str, pose: int, other: Stand, size: int, colours: bool) -> bool:
        """Return whether something of another robot might be seen: it is not out of view or behind the home."""
        key = (robot, pose, other, size)
        shows = self._in_view.get(key)
        if shows is None:
            if len(self._in_view) == _KEPT:
                self._in_view.clear()
            name, _, _ = other
            state = self._world.state.robots[name]
            x, y, z = state.base[0]
            height, radius = self._movables.ball(name, state.joints)
            sight = self._empty(robot, size, colours).sight
            ball = np.array((x, y, z + height, radius))
            shows = self._in_view[key] = bool(bounds.may_show(ball, sight.lens, sight.tiles, size))
        return shows

    def _with(self, robots: Sequence[Stand]) -> NDArray[np.int32]:
        """Put robots where they are, and return the numbers of the objects and of these robots."""
        if not robots:
            return self._numbers
        present = np.empty(len(self._numbers) + len(robots), np.int32)
        present[: len(self._numbers)] = self._numbers
        for place, (name, _, _) in enumerate(robots, start=len(self._numbers)):
            state = self._world.state.robots[name]
            self._bodies.put_robot(name, state.base, state.joints)
            present[place] = self._body_numbers[name]
        return present

    def _present(self, robot: str) -> NDArray[np.int32]:
        """Put all that a robot could see where it is, and return its numbers."""
        self._update_objects()
        return self._with(self._others(robot))

    def _forget_images(self) -> None:
        self._images.clear()
        self._image_bytes = 0

    def _update_objects(self) -> None:
        """Put the objects where they are."""
        objects = self._world.state.objects
        if objects is not self._objects:
            self._bodies.put_objects(objects.poses)
            if self._objects is None or objects.poses.keys() != self._objects.poses.keys():
                self._numbers = np.array([self._body_numbers[name] for name in self._world.objects], dtype=np.int32)
            self._seen = _seen_of(objects, self._team)
            self._forget_images()
            self._objects = objects


@cache
def _nothing() -> tuple[Picture, NDArray[np.float32]]:
    """Return a view of no home, and its tiles."""
    empty = empty_picture(VISIBILITY_SIZE)
    return empty, bounds.farthest(empty.depth)


def _seen_of(objects: Objects, team: Team) -> Seen:
    """Return what has been seen of these very objects, in all worlds of this process: tasks are played repeatedly."""
    number = id(objects), team  # nobody else's as long as the objects are kept
    _, seen = _seen.setdefault(number, (objects, {}))
    _seen.move_to_end(number)
    if len(_seen) > _ARRANGEMENTS:
        _seen.popitem(last=False)
    return seen


@lru_cache(maxsize=2**14)
def _posture(joints: Joints) -> int:
    """Return a number for positions of joints, which no others ever have."""
    return next(_postures)


def _sees_itself(own: Movables, model: RobotModel, robot: str, joints: Joints) -> bool:
    """Return whether a robot's camera shows its own body: it is drawn alone, in four headings."""
    bodies, camera, mount = Bodies(own), camera_of(model), model.camera
    number = np.array([own.numbers[robot]], np.int32)
    for yaw in np.arange(4) * np.pi / 2:
        base = (0.0, 0.0, 0.0), yaw_quaternion(float(yaw))
        bodies.put_robot(robot, base, joints)
        view = HomeView(view_matrix(mount.eye(base, float(yaw))), empty_picture(VISIBILITY_SIZE), camera)
        if (draw_over(view, bodies, number, 0).segmentation >= 0).any():
            return True
    return False
