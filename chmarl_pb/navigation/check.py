"""Check of a home's files, names and geometry: rooms that can be reached, receptacles with free tops within reach.

All problems are found in one pass. Whether tasks can be played in the home is tried by :mod:`chmarl_pb.tasks.trial`.
"""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import Home, read_home
from chmarl_pb.homes.oddities import find_oddities
from chmarl_pb.homes.problem import Findings, Problem
from chmarl_pb.homes.rooms import Room, Thing
from chmarl_pb.navigation.free_space import Size, Space, grip_point, space_of
from chmarl_pb.navigation.lattice import FOOTPRINT, reached_lattice, unreachable
from chmarl_pb.navigation.surfaces import CELL

#: Most furniture and scenery of one home: a scene graph has room for these, the objects and two robots.
MOST_THINGS = 64
#: Most rooms of one home, for the same reason.
MOST_ROOMS = 8

_SMALL: Size = (0.1, 0.1, 0.1)  # metres: an object that every receptacle must have a place for
_SAMPLES = 16  # places of a receptacle that are tried for reach


@dataclass(frozen=True)
class Top:
    """What a receptacle offers.

    Attributes:
        area: of its free level tops, square metres.
        places: number of places for a small object.
        reached: of them, how many the arm reaches; worked out from a sample.
    """

    area: float
    places: int
    reached: int


@dataclass(frozen=True)
class HomeReport:
    """What a check found.

    Attributes:
        path: the URDF.
        home: the home as far as it can be read, or None.
        tops: receptacle -> what it offers.
        problems: what is wrong; a home without an error among them can be played.
    """

    path: Path
    home: Home | None
    tops: dict[str, Top]
    problems: tuple[Problem, ...]

    @property
    def errors(self) -> list[Problem]:
        """The problems with which it cannot be played."""
        return [problem for problem in self.problems if problem.severity == "error"]

    @property
    def warnings(self) -> list[Problem]:
        """The other problems."""
        return [problem for problem in self.problems if problem.severity == "warning"]

    @property
    def rooms(self) -> dict[str, Room]:
        """Name -> room."""
        return {} if self.home is None else self.home.rooms

    def with_problems(self, problems: tuple[Problem, ...]) -> "HomeReport":
        """Return the report with more problems."""
        return replace(self, problems=(*self.problems, *problems))

    def as_dict(self) -> dict[str, Any]:
        """Return all of it, as JSON writes it."""
        return {
            "file": str(self.path),
            "playable": not self.errors,
            "problems": [problem.as_dict() for problem in self.problems],
            "rooms": [{"name": name, "area": round(room.area, 2)} for name, room in self.rooms.items()],
            "receptacles": [
                {
                    "name": name,
                    "free_area": round(top.area, 3),
                    "places": top.places,
                    "reached": top.reached,
                }
                for name, top in self.tops.items()
            ],
        }


def check_home(name_or_path: str | Path, known: Catalog = BENCHMARK) -> HomeReport:
    """Check a home, read with a catalogue.

    Raises:
        HomeError: there is no such home.
    """
    reading = read_home(name_or_path, known)
    found, home, tops = reading.found.copy(), reading.home, dict[str, Top]()
    if home is not None:
        for problem in limits(home):
            found.error(problem)
        find_oddities(home, found)
        if len(home.things) <= MOST_THINGS and len(home.rooms) <= MOST_ROOMS:
            tops = _tops(home, found)
    return HomeReport(reading.path, home, tops, tuple(found.problems))


def limits(home: Home, robots: int = 2) -> list[str]:
    """Return a sentence for each thing about a home for which no environment of so many robots can play in it."""
    problems, most_things = [], MOST_THINGS - max(0, robots - 2)
    if not home.goto_rooms:
        problems.append(
            f"no room is one of {', '.join(catalog.ROOM_KINDS)}, so robots could not be sent anywhere; rename one"
        )
    for kind, count, most in (("things", len(home.things), most_things), ("rooms", len(home.rooms), MOST_ROOMS)):
        if count > most:
            problems.append(f"{count} {kind}, but a scene graph has room for {most}; remove some")
    return problems


def _tops(home: Home, found: Findings) -> dict[str, Top]:
    """Return what the receptacles offer, and list rooms and receptacles out of reach."""
    space = space_of(home)
    try:
        space.lattice  # noqa: B018
    except HomeError:
        lattice, missed = reached_lattice(home, FOOTPRINT)
        for name in missed:
            centre = (*home.rooms[name].centre.tolist(), 0.0)
            found.error(f"room {name!r} {unreachable(FOOTPRINT)}", _floor_of(home, name), centre)
        space = Space(home, {FOOTPRINT: lattice})
    try:
        space.surfaces  # noqa: B018
    except HomeError as error:
        found.error(str(error).removeprefix(f"{home.path}: "))
        return {}
    tops = {name: _top(space, name) for name in home.receptacles}
    for name, top in tops.items():
        if not top.reached:
            found.error(_why_not(home.receptacles[name], top), name)
    for thing in home.things:
        if thing.class_name in home.catalog.receptacles and not thing.solids:
            found.error("it has no <collision>, so nothing can stand on it; add one", thing.name)
    if len({thing.class_name for thing in home.receptacles.values()}) < 2:
        found.error("a task needs receptacles of at least two classes; add furniture")
    return tops


def _floor_of(home: Home, room: str) -> str:
    return next(thing.name for thing in home.structure if thing.class_name == "floor" and thing.room == room)


def _top(space: Space, receptacle: str) -> Top:
    area = sum(
        float(np.count_nonzero(surface.free)) * CELL**2
        for surface in space.surfaces
        if surface.receptacle == receptacle
    )
    places = np.unique(space.places(receptacle, _SMALL)[:, :3], axis=0)
    return Top(area, len(places), _reached(space, places))


def _reached(space: Space, places: np.ndarray) -> int:
    """Return how many places are within reach: all are tried only if none of some spread over them is."""
    some = places[:: max(1, len(places) // _SAMPLES)]
    share = _count_reached(space, some) / max(1, len(some))
    return max(1, round(share * len(places))) if share else _count_reached(space, places)


def _count_reached(space: Space, places: np.ndarray) -> int:
    return sum(space.stand(grip_point((x, y, z), _SMALL)) is not None for x, y, z in places.tolist())


def _why_not(thing: Thing, top: Top) -> str:
    """Return why nothing can be put on a receptacle."""
    if top.places:
        return (
            f"no free surface that the arm reaches: none of its {top.places} places can be reached; it needs free "
            "floor within 0.9 m of them"
        )
    levels = sorted({round(solid.top, 2) for solid in thing.solids if solid.facet is not None})
    found = f"level tops at {', '.join(f'{level:.2f} m' for level in levels)}" if levels else "no level top at all"
    concave = "" if levels else ", for a collision mesh counts as its convex hull"
    return (
        f"no free surface that the arm reaches: it has {found}{concave}; it needs a level top of at least "
        "0.25 m x 0.25 m between 0.25 m and 1.45 m high, and 0.12 m of free height over it"
    )
