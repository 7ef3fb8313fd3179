"""Pictures of the empty home, drawn once for each camera pose and kept.

A home's static geometry seen from a lattice pose never changes, so a step only has to draw what
moves (see :mod:`chmarl_pb.sensing.movables`).
"""

from collections import OrderedDict
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np
import pybullet
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.homes.space import Space, space_of
from chmarl_pb.sensing.camera import Picture, Vector, render, view_matrix
from chmarl_pb.sensing.eyes import CAMERAS, eye
from chmarl_pb.world import load_home_body, quiet

CAPACITY = 384 * 2**20  # bytes of kept pictures in this process


@dataclass(frozen=True, eq=False)
class HomeView:
    """The empty home from one camera pose.

    Attributes:
        view: view matrix.
        picture: its segmentation holds PyBullet link indices of the home, -1 for nothing.
    """

    view: Vector
    picture: Picture

    @cached_property
    def pixels(self) -> NDArray[np.int64]:
        """Number of pixels of each link, by link index; shorter than the list of links at its end."""
        return count_pixels(self.picture.segmentation, 0)


def count_pixels(segmentation: NDArray[np.integer], length: int) -> NDArray[np.int64]:
    """Return how often each value from 0 stands in a segmentation, at least ``length`` of them."""
    return np.bincount(segmentation.ravel() + 1, minlength=length + 1)[1:]


class HomeViews:
    """All views of one home, shared by every environment of this process."""

    def __init__(self, home: Home):
        """Load the home into a client of its own."""
        self.space: Space = space_of(home)
        self.client = pybullet.connect(pybullet.DIRECT)
        with quiet():
            load_home_body(self.client, home)
        self._kept = _kept()

    def look(self, robot: str, pose: int, size: int) -> HomeView:
        """Return the empty home as a robot's camera sees it from a lattice pose.

        Args:
            robot: "humanoid" or "drone".
            pose: its pose on its lattice.
            size: width and height in pixels.
        """
        key = (self.client, robot, pose, size)
        view = self._kept.get(key)
        if view is None:
            matrix = view_matrix(eye(self.space, robot, pose))
            drawn = render(self.client, CAMERAS[robot], matrix, size)
            # TinyRenderer rounds rare colours differently in every other picture of a client: a second one of a single
            # pixel lets each kept view be an odd one, whatever was drawn before.
            render(self.client, CAMERAS[robot], matrix, 1)
            links = np.where(drawn.segmentation < 0, -1, (drawn.segmentation >> 24) - 1).astype(np.int16)
            view = HomeView(matrix, Picture(drawn.colour, drawn.depth, links))
            self._kept.put(key, view)
        return view


Key = tuple[int, str, int, int]  # client, robot, pose, size


class KeptViews:
    """The views of all homes of this process; those that were not used for longest give way."""

    def __init__(self, capacity: int):
        """Keep at most this many bytes of pictures."""
        self._capacity, self._bytes = capacity, 0
        self._views: OrderedDict[Key, HomeView] = OrderedDict()

    def get(self, key: Key) -> HomeView | None:
        """Return a kept view, or None."""
        view = self._views.get(key)
        if view is not None:
            self._views.move_to_end(key)
        return view

    def put(self, key: Key, view: HomeView) -> None:
        """Keep a view."""
        self._views[key] = view
        self._bytes += _size(view)
        while self._bytes > self._capacity:
            self._bytes -= _size(self._views.popitem(last=False)[1])


@cache
def _kept() -> KeptViews:
    return KeptViews(CAPACITY)


def _size(view: HomeView) -> int:
    picture = view.picture
    return picture.colour.nbytes + picture.depth.nbytes + picture.segmentation.nbytes


@lru_cache(maxsize=16)
def home_views(home: Home) -> HomeViews:
    """Return the views of a home, shared within this process."""
    return HomeViews(home)
