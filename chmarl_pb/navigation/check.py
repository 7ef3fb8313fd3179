"""Check that a home can be played: safe, well named, connected, and every receptacle within reach."""

from dataclasses import dataclass
from pathlib import Path

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import Home, load_home
from chmarl_pb.navigation.free_space import Size, Space, grip_point, space_of

#: Most furniture and scenery of one home: a scene graph has room for these, the objects and two robots.
MOST_THINGS = 64
#: Most rooms of one home, for the same reason.
MOST_ROOMS = 8

_SMALL: Size = (0.1, 0.1, 0.1)  # metres: an object that every receptacle must have a place for


@dataclass(frozen=True)
class HomeReport:
    """What a check found.

    Attributes:
        home: the home.
        places: receptacle -> number of places for a small object that the arm reaches.
        problems: one sentence for each; a home with none can be played.
    """

    home: Home
    places: dict[str, int]
    problems: tuple[str, ...]


def check_home(name_or_path: str | Path, known: Catalog = BENCHMARK) -> HomeReport:
    """Check a home, read with a catalogue.

    Raises:
        HomeError: the URDF cannot be read as a home at all, or a room cannot be reached.
    """
    home = load_home(name_or_path, known)
    space = space_of(home)
    problems = limits(home)
    try:
        problems += [] if len(space.lattice.points) else ["no free floor"]
    except HomeError as error:
        return HomeReport(home, {}, (*problems, str(error)))
    places = {name: count_places(space, name, _SMALL) for name in home.receptacles}
    for name, count in places.items():
        if not count:
            problems.append(
                f"link {name!r}: no free surface that the arm reaches; it needs a level top of at least "
                "0.25 m x 0.25 m between 0.25 m and 1.45 m high, and free floor within 0.9 m of it"
            )
    for thing in home.things:
        if thing.class_name in home.catalog.receptacles and not thing.solids:
            problems.append(f"link {thing.name!r} has no <collision>, so nothing can stand on it; add one")
    if len({thing.class_name for thing in home.receptacles.values()}) < 2:
        problems.append("a task needs receptacles of at least two classes; add furniture")
    return HomeReport(home, places, tuple(problems))


def limits(home: Home, robots: int = 2) -> list[str]:
    """Return a sentence for each thing about a home for which no environment of so many robots can play in it."""
    problems, most_things = [], MOST_THINGS - max(0, robots - 2)
    if not home.goto_rooms:
        problems.append(f"no room is one of {', '.join(catalog.ROOM_KINDS)}; robots could not be sent anywhere")
    for kind, count, most in (("things", len(home.things), most_things), ("rooms", len(home.rooms), MOST_ROOMS)):
        if count > most:
            problems.append(f"{count} {kind}, but a scene graph has room for {most}; remove some")
    return problems


def count_places(space: Space, receptacle: str, size: Size) -> int:
    """Return how many places of a receptacle hold an object of a size and can be reached."""
    places = space.places(receptacle, size)[:, :3].tolist()
    return sum(space.stand(grip_point((x, y, z), size)) is not None for x, y, z in places)
