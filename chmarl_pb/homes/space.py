"""All that a home offers to robots: lattices, surfaces, and from where each point can be reached."""

from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from chmarl_pb.homes.home import Home
from chmarl_pb.homes.lattice import HEADINGS, DroneLattice, Lattice, build_drone_lattice, build_lattice, heading_angle
from chmarl_pb.homes.reach import REACH
from chmarl_pb.homes.solids import Outlines, Points
from chmarl_pb.homes.surfaces import Surface, find_surfaces

#: Share of an object's height at which it is gripped.
GRIP = 0.6
_ARM_THICKNESS = 0.12  # metres of free height that the forearm needs above the grip
_BEST_DISTANCE = 0.62  # metres from base to grip that the arm likes most

Size = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Space:
    """What can be derived from a home once and serves every world and planner of it."""

    home: Home
    _stands: dict[tuple[float, float, float], int | None] = field(default_factory=dict)
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
        key = (round(grip[0], 4), round(grip[1], 4), round(grip[2], 4))
        if key not in self._stands:
            self._stands[key] = self._find_stand(*key)
        return self._stands[key]

    def _find_stand(self, x: float, y: float, z: float) -> int | None:
        away = np.array([x, y]) - self.lattice.points
        distance = np.hypot(*away.T)
        near = np.flatnonzero((distance >= REACH.distance[0]) & (distance <= REACH.distance[1]))
        bearing = np.arctan2(away[near, 1], away[near, 0])
        heading = np.round(bearing / heading_angle(1)).astype(int)
        off = np.abs(bearing - heading * heading_angle(1))
        cost = np.abs(distance[near] - _BEST_DISTANCE) + 0.5 * off
        for choice in np.lexsort((near, np.round(cost, 6))):
            position = near[choice]
            if REACH.contains(distance[position], z, off[choice]) and self._arm_is_free(
                self.lattice.points[position], x, y, z
            ):
                return int(position * HEADINGS + heading[choice] % HEADINGS)
        return None

    def _arm_is_free(self, base: Points, x: float, y: float, z: float) -> bool:
        """Return whether nothing stands between the base and the point at the arm's height."""
        tall = (self._heights[:, 1] > z) & (self._heights[:, 0] < z + _ARM_THICKNESS)
        return not (self._outlines.crossed(base[None], np.array([[x, y]]))[0] & tall).any()

    @cached_property
    def _heights(self) -> Points:
        """Bottom and top (n, 2) of the home's solids."""
        return np.array([[solid.bottom, solid.top] for solid in self.home.solids]).reshape(-1, 2)

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
