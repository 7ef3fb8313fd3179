"""Pictures of the empty home, drawn once for each camera pose and kept.

A home's static geometry seen from a lattice pose never changes, so a step only has to draw what
moves (see :mod:`chmarl_pb.sensing.movables`).
"""

from collections import OrderedDict
from dataclasses import dataclass
from functools import cached_property, lru_cache

import numpy as np
import pybullet
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.homes.space import Space, space_of
from chmarl_pb.sensing.camera import Picture, Vector, render, view_matrix
from chmarl_pb.sensing.eyes import CAMERAS, eye
from chmarl_pb.world import load_home_body, quiet

_CAPACITY = 256 * 2**20  # bytes of kept pictures per home


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


def count_pixels(segmentation: NDArray[np.int32], length: int) -> NDArray[np.int64]:
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
        self._kept: OrderedDict[tuple[str, int, int], HomeView] = OrderedDict()
        self._bytes = 0

    def look(self, robot: str, pose: int, size: int) -> HomeView:
        """Return the empty home as a robot's camera sees it from a lattice pose.

        Args:
            robot: "humanoid" or "drone".
            pose: its pose on its lattice.
            size: width and height in pixels.
        """
        key = (robot, pose, size)
        if key in self._kept:
            self._kept.move_to_end(key)
            return self._kept[key]
        view = view_matrix(eye(self.space, robot, pose))
        drawn = render(self.client, CAMERAS[robot], view, size)
        links = np.where(drawn.segmentation < 0, -1, (drawn.segmentation >> 24) - 1)
        kept = HomeView(view, Picture(drawn.colour, drawn.depth, links))
        self._keep(key, kept)
        return kept

    def _keep(self, key: tuple[str, int, int], view: HomeView) -> None:
        self._kept[key] = view
        self._bytes += _size(view)
        while self._bytes > _CAPACITY:
            self._bytes -= _size(self._kept.popitem(last=False)[1])


def _size(view: HomeView) -> int:
    picture = view.picture
    return picture.colour.nbytes + picture.depth.nbytes + picture.segmentation.nbytes


@lru_cache(maxsize=16)
def home_views(home: Home) -> HomeViews:
    """Return the views of a home, shared within this process."""
    return HomeViews(home)
