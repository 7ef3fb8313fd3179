"""All that a home offers to robots: lattices, surfaces, and from where each point can be reached."""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np

from chmarl_pb.homes.home import Home
from chmarl_pb.homes.solids import Outlines, Points
from chmarl_pb.navigation.lattice import (
    HEADINGS,
    DroneLattice,
    Lattice,
    build_drone_lattice,
    build_lattice,
    heading_angle,
)
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.navigation.surfaces import Surface, find_surfaces

#: Share of an object's height at which it is gripped.
GRIP = 0.6
_ARM_THICKNESS = 0.12  # metres of free height that the forearm needs above the grip
_BEST_DISTANCE = 0.62  # metres from base to grip that the arm likes most

Size = tuple[float, float, float]


class _Approach(NamedTuple):
    """A way to reach a point: the lattice pose, and bottom and top of all that stands between them (metres)."""

    pose: int
    barriers: Points


@dataclass(frozen=True, eq=False)
class Space:
    """What can be derived from a home once and serves every world and planner of it."""

    home: Home
    _approaches: dict[tuple[float, float], tuple[_Approach, ...]] = field(default_factory=dict)
    _places: dict[tuple[str, Size], Points] = field(default_factory=dict)

    @cached_property
    def lattice(self) -> Lattice:
        """The humanoid's lattice."""
        return build_lattice(self.home)

    @cached_property
    def drone_lattice(self) -> DroneLattice:
        """The drone's lattice."""
        return build_drone_lattice(self.home)

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """All surfaces of receptacles."""
        return find_surfaces(self.home)

    def stand(self, grip: tuple[float, float, float]) -> int | None:
        """Return the lattice pose from which the arm reaches a point best, or None.

        Args:
            grip: x, y, z of the point in the world, metres.
        """
        x, y, z = round(grip[0], 4), round(grip[1], 4), round(grip[2], 4)
        if (x, y) not in self._approaches:
            self._approaches[x, y] = self._find_approaches(x, y)
        if REACH.height[0] <= z <= REACH.height[1]:
            for approach in self._approaches[x, y]:
                heights = approach.barriers.tolist()
                if not any(top > z and bottom < z + _ARM_THICKNESS for bottom, top in heights):
                    return approach.pose
        return None

    def _find_approaches(self, x: float, y: float) -> tuple[_Approach, ...]:
        """Return the lattice poses that have a point at arm's length, best first."""
        points = self.lattice.points
        away = np.array([x, y]) - points
        distance = np.hypot(*away.T)
        near = np.flatnonzero((distance >= REACH.distance[0]) & (distance <= REACH.distance[1]))
        bearing = np.arctan2(away[near, 1], away[near, 0])
        heading = np.round(bearing / heading_angle(1)).astype(int)
        off = np.abs(bearing - heading * heading_angle(1))  # at most half a step: well within REACH.bearing
        cost = np.abs(distance[near] - _BEST_DISTANCE) + 0.5 * off
        order = np.lexsort((near, np.round(cost, 6)))
        poses = (near * HEADINGS + heading % HEADINGS)[order].tolist()
        return tuple(map(_Approach, poses, self._barriers(points[near[order]], np.array([x, y]))))

    def _barriers(self, starts: Points, end: Points) -> list[Points]:
        """Return bottom and top of the solids that stand on the line from each start to an end."""
        low, high = (
            np.minimum(starts.min(axis=0, initial=np.inf), end),
            np.maximum(starts.max(axis=0, initial=-np.inf), end),
        )
        near = np.flatnonzero(((self._boxes[:, :2] <= high + 1e-6) & (self._boxes[:, 2:] >= low - 1e-6)).all(axis=1))
        crossed = self._outlines.crossed(starts, np.repeat(end[None], len(starts), axis=0), near)
        return [self._heights[near[row]] for row in crossed]

    @cached_property
    def _heights(self) -> Points:
        """Bottom and top (n, 2) of the home's solids."""
        return np.array([[solid.bottom, solid.top] for solid in self.home.solids]).reshape(-1, 2)

    @cached_property
    def _boxes(self) -> Points:
        """Lower and upper corner (n, 4) of the outlines of the home's solids."""
        return np.array([[*solid.low, *solid.high] for solid in self.home.solids]).reshape(-1, 4)

    @cached_property
    def _outlines(self) -> Outlines:
        return Outlines([solid.polygon for solid in self.home.solids])

    def places(self, receptacle: str, size: Size) -> Points:
        """Return x, y, z and yaw (n, 4) of every place on a receptacle where an object fits.

        The object lies along the receptacle's axes, as it is or turned by a quarter. The places are
        its bottom centre, in a fixed order; not all of them need be within the arm's reach.

        Args:
            receptacle: name of the thing.
            size: extents of the object along its own x, y and z, metres.
        """
        key = (receptacle, size)
        if key not in self._places:
            found = [_places_on(surface, size) for surface in self.surfaces if surface.receptacle == receptacle]
            # Column by column in memory: what asks for the places works on columns.
            self._places[key] = np.asfortranarray(np.concatenate([np.zeros((0, 4)), *found]))
        return self._places[key]


def _places_on(surface: Surface, size: Size) -> Points:
    rows = []
    # Turned first: an object's long side then lies along the width of furniture, as people put it.
    for turn, extents in ((np.pi / 2, (size[1], size[0], size[2])), (0.0, size)):
        cells = surface.fits(extents)
        where = surface.points[cells[:, 0], cells[:, 1]]
        rows.append(
            np.column_stack([where, np.full(len(cells), surface.height), np.full(len(cells), surface.yaw + turn)])
        )
    return np.concatenate(rows)


def grip_point(position: tuple[float, float, float], size: Size) -> tuple[float, float, float]:
    """Return where an object at a position (its bottom centre) is gripped."""
    return position[0], position[1], position[2] + GRIP * size[2]


@lru_cache(maxsize=16)
def space_of(home: Home) -> Space:
    """Return the space of a home, shared by all who use that home in this process."""
    return Space(home)
