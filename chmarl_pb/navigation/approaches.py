"""From where an arm reaches a point: the lattice poses at arm's length of it, best first."""

from collections.abc import Collection, Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.homes.solids import Outlines, Points, Solid
from chmarl_pb.navigation.lattice import HEADINGS, Lattice, heading_angle
from chmarl_pb.navigation.reach import Reach

_KEPT = 16_384  # points, 1 kB each
_STEP = heading_angle(1)
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
        cells = np.array(list(taken), dtype=np.int64)
        pose = int(_first_free(*self._known[x, y], z, *span, cells))
        return None if pose < 0 else pose

    def _find_ways(self, x: float, y: float) -> _Ways:
        """Return the ways to reach a point from the lattice poses that have it at arm's length."""
        shortest, longest = self._reach.distance
        points = self._lattice.points
        first, last = np.searchsorted(points[:, 0], (x - longest - 1e-6, x + longest + 1e-6))  # they are sorted by x
        away = np.array([x, y]) - points[first:last]
        # NumPy's functions, as those of compiled code may differ in the last bit.
        distances, bearings = np.hypot(away[:, 0], away[:, 1]), np.arctan2(away[:, 1], away[:, 0])
        chosen, headings = _best_first(distances, bearings, shortest, longest, self._reach.best)
        cells = chosen + first
        poses, end = cells * HEADINGS + headings, np.array([x, y])
        return _Ways(poses, distances[chosen], *self._solids_between(points[cells], end))

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


@compiled
def _best_first(distances, bearings, shortest, longest, best):  # type: ignore[no-untyped-def]
    """Return the numbers (n,) of the places at arm's length of a point, those that the arm likes most first.

    Args:
        distances: (m,) of the point from places, metres.
        bearings: (m,) from places to the point, radians.
        shortest: distance at arm's length, metres.
        longest: distance at arm's length, metres.
        best: distance that the arm likes most, metres.

    Returns:
        The numbers, and at each place the heading (n,) that is nearest to the bearing.
    """
    chosen, headings, costs = (
        np.empty(len(distances), np.int64),
        np.empty(len(distances), np.int64),
        np.empty(len(distances)),
    )
    count = 0
    for number in range(len(distances)):
        if not shortest <= distances[number] <= longest:
            continue
        heading = np.rint(bearings[number] / _STEP)
        off = abs(bearings[number] - heading * _STEP)  # at most half a step: well within the reach's bearing
        cost, place = np.rint((abs(distances[number] - best) + 0.5 * off) * 1e6), count
        while place > 0 and costs[place - 1] > cost:
            chosen[place], headings[place], costs[place] = chosen[place - 1], headings[place - 1], costs[place - 1]
            place -= 1
        chosen[place], headings[place], costs[place] = number, int(heading) % HEADINGS, cost
        count += 1
    return chosen[:count], headings[:count]


@compiled
def _first_free(poses, distances, crossed, bottom, top, z, nearest, farthest, taken):  # type: ignore[no-untyped-def]
    """Return the first pose of :class:`_Ways` from which an arm reaches a point, -1 if there is none.

    Args:
        poses: as the ways have them, and so are the next four.
        distances: of the point, metres.
        crossed: which solids stand in between.
        bottom: of the solids.
        top: of the solids.
        z: height of the point, metres.
        nearest: distance that it has at least, metres.
        farthest: distance that it has at most, metres.
        taken: (k,) cells in which somebody else stands.
    """
    for way in range(len(poses)):
        free = nearest <= distances[way] <= farthest
        for cell in taken:
            free = free and cell != poses[way] // HEADINGS
        if free and _is_clear(crossed[way], bottom, top, z):
            return poses[way]
    return -1


@compiled
def _is_clear(crossed, bottom, top, z):  # type: ignore[no-untyped-def]
    """Return whether nothing that stands in between (m,) is in the way of a forearm at a height."""
    for solid in range(len(top)):
        if crossed[solid] and top[solid] > z and bottom[solid] < z + _ARM_THICKNESS:
            return False
    return True
