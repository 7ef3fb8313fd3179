"""Pictures of the empty home, drawn once for each camera pose and kept.

A home's static geometry seen from a lattice pose never changes, so a step only has to draw what
moves (see :mod:`chmarl_pb.rendering.movables`). Pictures are kept on disk where that is possible (see
:mod:`chmarl_pb.rendering.view_store`) and in memory otherwise.
"""

import platform
import sys
import weakref
from collections import OrderedDict
from collections.abc import Iterator
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache
from itertools import count
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import COMPILES
from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.content import content_hash
from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.free_space import Space, space_of
from chmarl_pb.rendering.bounds import Sight
from chmarl_pb.rendering.camera import Camera, Picture, camera_of, lens, render, view_matrix
from chmarl_pb.rendering.home_model import HomeModel
from chmarl_pb.rendering.view_file import ViewFile
from chmarl_pb.rendering.view_store import FORMAT, view_memory, view_store
from chmarl_pb.rendering.visible_pixels import count_pixels
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import Client, Vector, World, loaded_home
from chmarl_pb.world.bullet import distribution, pybullet

#: Part of the hash in the names of stored pictures: raise it when homes are drawn differently, be it by one bit.
#: ``tests/rendering/test_drawing.py`` fails when they are.
DRAWING = 1
_SAMPLED = 12  # camera poses that stand for all in the names of files, with the lattice
_OWN = 4096  # bytes of a kept view beside its picture
_numbers = count()


@dataclass(frozen=True, eq=False)
class HomeView:
    """The empty home from one camera pose.

    Attributes:
        view: view matrix.
        picture: its segmentation holds PyBullet link indices of the home, -1 for nothing.
        camera: the camera that it was drawn with.
    """

    view: Vector
    picture: Picture
    camera: Camera

    @cached_property
    def sight(self) -> Sight:
        """The camera at its pose and how far it sees, as bodies are drawn there."""
        return Sight(lens(self.camera, self.view), self.picture.depth)

    @cached_property
    def pixels(self) -> NDArray[np.int64]:
        """Number of pixels of each link, by link index; shorter than the list of links at its end."""
        return count_pixels(self.picture.segmentation, 0)


class HomeViews:
    """All views of one home, shared by every environment of this process, and with others through the disk."""

    def __init__(self, home: Home):
        """Prepare to draw a home; it is loaded at the first view that is not on disk."""
        self.space: Space = space_of(home)
        self._number = next(_numbers)
        self._store = view_store()
        self._files: dict[tuple[RobotModel, int, bool], ViewFile | None] = {}
        self._coloured: dict[tuple[RobotModel, int], bool] = {}  # camera and size -> whether its views have colours
        self._kept = _kept()
        weakref.finalize(self, self._kept.drop, self._number).atexit = False
        self._model: HomeModel | None = None
        self._model_is_known = False

    @cached_property
    def _drawer(self) -> Client:
        """The client in which TinyRenderer draws nothing else: other pictures would change how it rounds colours."""
        with self._loaded() as (client, _):
            return client

    def look(
        self, robot: RobotModel, pose: int, size: int, world: World | None = None, colours: bool = True
    ) -> HomeView:
        """Return the empty home as a robot's camera sees it from a lattice pose.

        Args:
            robot: its kind.
            pose: its pose on its lattice.
            size: width and height in pixels.
            world: one of this home, so that the home need not be loaded once more.
            colours: whether the picture has to have colours; without them it is drawn in half of the time.

        Raises:
            HomeError: the home's files have changed since it was read.
        """
        colours = self._colours(robot, size, colours)
        key = (self._number, robot, pose, size, colours)
        view = self._kept.get(key)
        if view is None:
            view, taken = self._find(robot, pose, size, world, colours)
            self._kept.put(key, view, taken)
        return view

    def _colours(self, robot: RobotModel, size: int, wanted: bool) -> bool:
        """Return whether a view has colours; also for those who want none, if they are there or others want them.

        To draw one twice takes longer than to draw it with colours at once.
        """
        key = (robot, size)
        known = self._coloured.get(key)
        if known is None:
            known = not COMPILES or (self._store is not None and self._store.has(self._file_name(robot, size, True)))
            self._coloured[key] = known
        if wanted and not known:
            self._coloured[key] = known = True
        return known

    def _find(
        self, robot: RobotModel, pose: int, size: int, world: World | None, colours: bool
    ) -> tuple[HomeView, int]:
        """Return a view that this process does not keep yet, and how many bytes of memory it takes."""
        matrix, camera = view_matrix(robot.eye(self.space, pose)), camera_of(robot)
        file, taken = self._file(robot, size, colours), _OWN
        picture = file.get(pose, matrix) if file else None
        if picture is None:
            drawn = self.draw(camera, matrix, size, world, colours).picture
            picture = file.put(pose, matrix, drawn) if file else None
            if picture is None:
                picture, taken = drawn, _OWN + _bytes(drawn)
        return HomeView(matrix, picture, camera), taken

    def draw(
        self, camera: Camera, view: Vector, size: int, world: World | None = None, colours: bool = True
    ) -> HomeView:
        """Draw the empty home anew, from anywhere.

        Args:
            camera: the camera.
            view: its view matrix.
            size: width and height in pixels.
            world: one of this home, so that the home need not be loaded once more.
            colours: whether the picture has to have colours.
        """
        if not self._model_is_known:
            self._model, self._model_is_known = self._read_model(world), True
        if self._model is not None:
            picture = self._model.draw(lens(camera, view), size, colours)
        else:
            drawn = render(self._drawer.number, camera, view, size)
            # TinyRenderer makes normals unit vectors at every use, in place, which rounds some of them to and fro: a
            # second picture of a single pixel lets each one that is kept be an odd one.
            render(self._drawer.number, camera, view, 1)
            links = np.where(drawn.segmentation < 0, -1, (drawn.segmentation >> 24) - 1).astype(np.int16)
            picture = Picture(drawn.colour, drawn.depth, links)
        for array in (picture.colour, picture.depth, picture.segmentation):
            array.flags.writeable = False
        return HomeView(view, picture, camera)

    def _read_model(self, world: World | None) -> HomeModel | None:
        """Return the home's triangles, or None if TinyRenderer is to draw them: plain Python would be slow at it."""
        if not COMPILES:
            return None
        try:
            if world is not None:
                self._check()
                with suppress(FileNotFoundError):  # its meshes were written for PyBullet alone, and are gone
                    return HomeModel(world.client, world.physics.home)
            with self._loaded() as (client, body), closing(client):
                return HomeModel(client.number, body)
        except AssetError:
            return None

    def _check(self) -> None:
        """Raise a HomeError if the home's files have changed since it was read."""
        home = self.space.home
        if content_hash(home) != home.content:
            raise HomeError(f"{home.path}: the home has changed since it was read; start again")

    @contextmanager
    def _loaded(self) -> Iterator[tuple[Client, int]]:
        """Yield a new client with the home, and the home's body; its meshes are there while the context lasts."""
        self._check()
        client = Client()  # disconnected when nobody keeps it
        with loaded_home(client.number, self.space.home) as body:
            yield client, body

    def _file(self, robot: RobotModel, size: int, colours: bool) -> ViewFile | None:
        """Return the views on disk of a robot's camera at a size, or None if there is no store."""
        key = (robot, size, colours)
        if key not in self._files:
            poses, name = robot.lattice(self.space).count, self._file_name(robot, size, colours)
            self._files[key] = self._store.open(name, poses, size, colours) if self._store else None
        return self._files[key]

    def _file_name(self, robot: RobotModel, size: int, colours: bool) -> str:
        """Return a name with a hash of everything that the pictures depend on."""
        lattice = robot.lattice(self.space)
        some_views = [view_matrix(robot.eye(self.space, pose)) for pose in range(min(_SAMPLED, lattice.count))]
        facts = (self.space.home.content, camera_of(robot), size, FORMAT, DRAWING, some_views, _library())
        depends_on = [repr(facts).encode(), lattice.points.tobytes()]
        kind = size if colours else f"{size}-plain"
        return f"{self.space.home.name[:40]}_{robot.name[:20]}_{kind}_{sha256_of(depends_on)}"


Key = tuple[int, RobotModel, int, int, bool]  # number of the home's views, robot, pose, size, colours


class KeptViews:
    """The views of all homes of this process; those that were not used for longest give way."""

    def __init__(self, capacity: int):
        """Keep at most this many bytes of pictures."""
        self._capacity, self._bytes = capacity, 0
        self._views: OrderedDict[Key, tuple[HomeView, int]] = OrderedDict()

    def get(self, key: Key) -> HomeView | None:
        """Return a kept view, or None."""
        kept = self._views.get(key)
        if kept is None:
            return None
        self._views.move_to_end(key)
        return kept[0]

    def put(self, key: Key, view: HomeView, size: int) -> None:
        """Keep a view that takes so many bytes of memory."""
        self._views[key] = view, size
        self._bytes += size
        while self._bytes > self._capacity:
            _, (_, given_back) = self._views.popitem(last=False)
            self._bytes -= given_back

    def drop(self, number: int) -> None:
        """Forget the views of a home: a picture of a file keeps the file open."""
        for key in list(self._views):
            if key[0] == number:
                _, given_back = self._views.pop(key)
                self._bytes -= given_back


@cache
def _kept() -> KeptViews:
    return KeptViews(view_memory())


def _bytes(picture: Picture) -> int:
    return picture.colour.nbytes + picture.depth.nbytes + picture.segmentation.nbytes


@cache
def _library() -> tuple[object, ...]:
    """Return what is known of the machine code that draws."""
    binary = Path(pybullet.__file__).stat().st_size
    return *distribution(), binary, sys.platform, platform.machine(), platform.libc_ver()


@lru_cache(maxsize=16)
def home_views(home: Home) -> HomeViews:
    """Return the views of a home, shared within this process."""
    return HomeViews(home)
