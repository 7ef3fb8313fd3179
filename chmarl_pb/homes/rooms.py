"""Rooms, which are the footprints of floors, and the things that stand in them."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.homes.problem import Findings, Refused
from chmarl_pb.homes.solids import Points, Solid, overlap

#: Metres that a home may measure from one end of its floors to the other: its lattice must fit into memory.
WIDEST = 60
#: Square metres of all floors, for the same reason; the benchmark's homes have 71 to 105.
LARGEST = 400

_LEVEL = 0.01  # metres that a floor's top may lie off z = 0
_LAPPED = 0.2  # metres that floors of two rooms may overlap, as below a wall between them


@dataclass(frozen=True, eq=False)
class Thing:
    """One static thing of a home: a piece of furniture, scenery or structure.

    Attributes:
        name: ``<room>/<class>_<n>``.
        frame: its link's frame in the world, 4 x 4.
        solids: its convex pieces, in the world frame.
    """

    name: str
    frame: Points
    solids: tuple[Solid, ...]

    @cached_property
    def class_name(self) -> str:
        """The class, e.g. ``stove``; it may be one that the catalogue does not know."""
        return catalog.class_of(self.name)

    @cached_property
    def room(self) -> str:
        """The room in its name."""
        return catalog.room_of(self.name)

    @cached_property
    def centre(self) -> Points:
        """Middle (2,) of its footprint; of its frame when it has no solids."""
        if not self.solids:
            return self.frame[:2, 3]
        middle: Points = (
            np.min([s.low for s in self.solids], axis=0) + np.max([s.high for s in self.solids], axis=0)
        ) / 2
        return middle


@dataclass(frozen=True, eq=False)
class Room:
    """One room: its name and the convex polygons of its floor (metres, world frame)."""

    name: str
    floors: tuple[Points, ...]

    @cached_property
    def centre(self) -> Points:
        """Area-weighted middle (2,) of the floor."""
        areas = np.array([_area(floor) for floor in self.floors])
        middle: Points = (areas[:, None] * np.array([floor.mean(axis=0) for floor in self.floors])).sum(
            axis=0
        ) / areas.sum()
        return middle

    @property
    def area(self) -> float:
        """Floor area in square metres."""
        return sum(_area(floor) for floor in self.floors)


def rooms_of(things: Sequence[Thing], found: Findings) -> dict[str, Room]:
    """Return the rooms, and list floors and rooms that are none.

    Raises:
        Refused: they, or a thing, are larger than a home can be.
    """
    for thing in things:
        if thing.class_name != "floor":
            _check_width(thing)
    floors: dict[str, list[Points]] = {}
    for thing in things:
        if thing.class_name == "floor":
            if not thing.solids:
                found.error("it has no <collision>; a floor's footprint is the room, add one", thing.name)
                continue
            top = max(solid.top for solid in thing.solids)
            if abs(top) > _LEVEL:
                found.error(f"its top lies at z = {top:.2f} m; a floor's top lies at z = 0, move it there", thing.name)
            floors.setdefault(thing.room, []).extend(solid.polygon for solid in thing.solids)
    if not floors:
        found.error("no floor; add a link <room>/floor_1 for every room, its top at z = 0")
        return {}
    for name, thing in {thing.room: thing for thing in reversed(things) if thing.room not in floors}.items():
        found.error(f"room {name!r} has no floor; add a link {name}/floor_1", thing.name)
    rooms = {name: Room(name, tuple(polygons)) for name, polygons in floors.items()}
    _check_apart(rooms, found)
    _check_size(rooms)
    return rooms


def _check_size(rooms: dict[str, Room]) -> None:
    """Check that a home is no larger than one can be.

    Raises:
        Refused: it is.
    """
    width = float(np.ptp(np.concatenate([polygon for room in rooms.values() for polygon in room.floors]), axis=0).max())
    if width > WIDEST:
        raise Refused(f"it is {width:,.0f} m wide, at most {WIDEST} m can be played; a URDF's unit is the metre")
    area = sum(room.area for room in rooms.values())
    if area > LARGEST:
        raise Refused(f"{area:,.0f} m2 of floor, at most {LARGEST} m2 can be played; make it smaller")


def _check_width(thing: Thing) -> None:
    """Check that a thing fits into the largest home.

    Raises:
        Refused: it does not, which makes all else that is wrong with the home of no use.
    """
    for solid in thing.solids:
        size = (*(solid.high - solid.low).tolist(), solid.top - solid.bottom)
        if max(size) > WIDEST:
            told = " x ".join(f"{length:,.4g}" for length in size)
            raise Refused(
                f"it measures {told} m, at most {WIDEST} m can be played; a URDF's unit is the metre", thing.name
            )


def _check_apart(rooms: dict[str, Room], found: Findings) -> None:
    """List rooms whose floors overlap: in which of them a robot is would depend on the order of the file."""
    for one, two in combinations(rooms.values(), 2):
        depth = max(_shared(a, b) for a in one.floors for b in two.floors)
        if depth > _LAPPED:
            found.error(
                f"it reaches {depth:.2f} m into the floor of {two.name!r}; let the floors of rooms touch",
                f"{one.name}/floor_1",
            )


def _shared(one: Points, other: Points) -> float:
    """Return how deep one floor reaches into another; 0 if their boxes do not."""
    meet = np.minimum(one.max(axis=0), other.max(axis=0)) - np.maximum(one.min(axis=0), other.min(axis=0))
    return overlap(one, other) if meet.min() > _LAPPED else 0.0


def _area(polygon: Points) -> float:
    x, y = polygon.T
    return float(abs(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2)
