"""All that a home offers to robots: lattices, surfaces, and from where each point can be reached."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache

import numpy as np

from chmarl_pb.homes.home import Home
from chmarl_pb.homes.solids import Points
from chmarl_pb.navigation.approaches import Approaches, GripPoint
from chmarl_pb.navigation.lattice import (
    FOOTPRINT,
    DroneLattice,
    Footprint,
    Lattice,
    build_drone_lattice,
    build_lattice,
)
from chmarl_pb.navigation.reach import REACH, Reach
from chmarl_pb.navigation.surfaces import Surface, find_surfaces

#: Share of an object's height at which it is gripped.
GRIP = 0.6

Size = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class Space:
    """What can be derived from a home once and serves every world and planner of it."""

    home: Home
    _lattices: dict[Footprint, Lattice] = field(default_factory=dict)
    _approaches: dict[tuple[Footprint, Reach], Approaches] = field(default_factory=dict)
    _places: dict[tuple[str, Size], Points] = field(default_factory=dict)
    _reached: dict[tuple[str, Size], dict[int, bool]] = field(default_factory=dict)

    @cached_property
    def lattice(self) -> Lattice:
        """The lattice of robots of the usual footprint, as the humanoid."""
        return self.lattice_of(FOOTPRINT)

    def lattice_of(self, footprint: Footprint) -> Lattice:
        """Return the lattice of robots of a footprint.

        Raises:
            HomeError: they cannot reach a room.
        """
        if footprint not in self._lattices:
            self._lattices[footprint] = build_lattice(self.home, footprint)
        return self._lattices[footprint]

    @cached_property
    def drone_lattice(self) -> DroneLattice:
        """The lattice of robots that fly."""
        return build_drone_lattice(self.home)

    @cached_property
    def surfaces(self) -> tuple[Surface, ...]:
        """All surfaces of receptacles."""
        return find_surfaces(self.home)

    def approaches(self, footprint: Footprint, reach: Reach) -> Approaches:
        """Return from where an arm on a base of a footprint reaches what."""
        key = footprint, reach
        if key not in self._approaches:
            self._approaches[key] = Approaches(self.home.solids, self.lattice_of(footprint), reach)
        return self._approaches[key]

    @cached_property
    def stand(self) -> Callable[[GripPoint], int | None]:
        """Return the pose from which the humanoid reaches a point best, or None; see :meth:`Approaches.stand`."""
        return self.approaches(FOOTPRINT, REACH).stand

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
            self._places[key] = np.concatenate([np.zeros((0, 4)), *found])
        return self._places[key]

    def reaches(self, receptacle: str, size: Size, number: int) -> bool:
        """Return whether the humanoid reaches an object at one of the places on a receptacle."""
        known = self._reached.setdefault((receptacle, size), {})
        if number not in known:
            x, y, z, _ = self.places(receptacle, size)[number].tolist()
            known[number] = self.stand(grip_point((x, y, z), size)) is not None
        return known[number]


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


def grip_point(position: GripPoint, size: Size) -> GripPoint:
    """Return where an object at a position (its bottom centre) is gripped."""
    return position[0], position[1], position[2] + GRIP * size[2]


@lru_cache(maxsize=16)
def space_of(home: Home) -> Space:
    """Return the space of a home, shared by all who use that home in this process."""
    return Space(home)
