"""From where an arm reaches a point: the lattice poses at arm's length of it, best first."""

from collections.abc import Collection, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.solids import Outlines, Points, Solid
from chmarl_pb.navigation.lattice import HEADINGS, Lattice, heading_angle
from chmarl_pb.navigation.reach import Reach

_KEPT = 16_384  # points, 1 kB each
_ARM_THICKNESS = 0.12  # metres of free height that the forearm needs above the grip

GripPoint = tuple[float, float, float]


class _Ways(NamedTuple):
    """The ways to reach a point, best first.

    Attributes:
        poses: (n,) lattice poses.
        distances: (n,) of the point from them, metres.
        crossed: (n, m) which solids stand between a pose and the point.
        bottom: (m,) of these solids, metres.
        top: (m,) of these solids, metres.
    """

    poses: NDArray[np.int64]
    distances: Points
    crossed: NDArray[np.bool_]
    bottom: Points
    top: Points


class Approaches:
    """From where one kind of arm reaches the points of one home."""

    def __init__(self, solids: Sequence[Solid], lattice: Lattice, reach: Reach):
        """Reach over a home's solids from the poses of a lattice."""
        self._solids, self._lattice, self._reach = solids, lattice, reach
        self._known: dict[tuple[float, float], _Ways] = {}
        self._stands: dict[GripPoint, int | None] = {}

    def stand(self, grip: GripPoint, taken: Collection[int] = ()) -> int | None:
        """Return the lattice pose from which the arm reaches a point best, or None.

        Args:
            grip: x, y, z of the point in the world, metres.
            taken: cells in which somebody else stands.
        """
        point = round(grip[0], 4), round(grip[1], 4), round(grip[2], 4)
        if taken:
            return self._find_stand(point, taken)
        if point not in self._stands:
            if len(self._stands) == _KEPT:
                self._stands.clear()
            self._stands[point] = self._find_stand(point, ())
        return self._stands[point]

    def _find_stand(self, point: GripPoint, taken: Collection[int]) -> int | None:
        x, y, z = point
        span = self._reach.span(z)
        if span is None:
            return None
        if (x, y) not in self._known:
            if len(self._known) == _KEPT:
                self._known.clear()
            self._known[x, y] = self._find_ways(x, y)
        ways = self._known[x, y]
        in_the_way = (ways.top > z) & (ways.bottom < z + _ARM_THICKNESS)
        free = ~ways.crossed[:, in_the_way].any(axis=1)
        if self._reach.bands:
            free &= (ways.distances >= span[0]) & (ways.distances <= span[1])
        for pose in ways.poses[free].tolist() if taken else ways.poses[free][:1].tolist():
            if pose // HEADINGS not in taken:
                return int(pose)
        return None

    def _find_ways(self, x: float, y: float) -> _Ways:
        """Return the ways to reach a point from the lattice poses that have it at arm's length."""
        shortest, longest = self._reach.distance
        points = self._lattice.points
        first, last = np.searchsorted(points[:, 0], (x - longest - 1e-6, x + longest + 1e-6))  # they are sorted by x
        away = np.array([x, y]) - points[first:last]
        distance = np.hypot(*away.T)
        near = np.flatnonzero((distance >= shortest) & (distance <= longest))
        bearing = np.arctan2(away[near, 1], away[near, 0])
        heading = np.round(bearing / heading_angle(1)).astype(int)
        off = np.abs(bearing - heading * heading_angle(1))  # at most half a step: well within the reach's bearing
        cost = np.abs(distance[near] - self._reach.best) + 0.5 * off
        far = distance[near]
        near += first
        order = np.lexsort((near, np.round(cost, 6)))
        poses = (near * HEADINGS + heading % HEADINGS)[order]
        return _Ways(poses, far[order], *self._solids_between(points[near[order]], np.array([x, y])))

    def _solids_between(self, starts: Points, end: Points) -> tuple[NDArray[np.bool_], Points, Points]:
        """Return which solids stand on the line from each start to an end, and their bottoms and tops."""
        low, high = (
            np.minimum(starts.min(axis=0, initial=np.inf), end),
            np.maximum(starts.max(axis=0, initial=-np.inf), end),
        )
        near = np.flatnonzero(((self._boxes[:, :2] <= high + 1e-6) & (self._boxes[:, 2:] >= low - 1e-6)).all(axis=1))
        crossed = self._outlines.crossed(starts, np.repeat(end[None], len(starts), axis=0), near)
        return crossed, *self._heights[near].T

    @cached_property
    def _heights(self) -> Points:
        """Bottom and top (n, 2) of the home's solids."""
        return np.array([[solid.bottom, solid.top] for solid in self._solids]).reshape(-1, 2)

    @cached_property
    def _boxes(self) -> Points:
        """Lower and upper corner (n, 4) of the outlines of the home's solids."""
        return np.array([[solid.low, solid.high] for solid in self._solids]).reshape(-1, 4)

    @cached_property
    def _outlines(self) -> Outlines:
        return Outlines([solid.polygon for solid in self._solids])
