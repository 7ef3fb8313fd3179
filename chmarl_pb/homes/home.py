"""A home as data, derived from its URDF alone: rooms, things and the solids that they are made of."""

import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import HomeError
from chmarl_pb.homes.generate.store import generate_home, generated_seed
from chmarl_pb.homes.object_looks import looks_in
from chmarl_pb.homes.problem import Findings, Refused, raise_first
from chmarl_pb.homes.rooms import Room, Thing, rooms_of
from chmarl_pb.homes.solids import Points, Solid, bounds
from chmarl_pb.homes.source import Source
from chmarl_pb.homes.urdf import Link, read_links
from chmarl_pb.kept import Kept

_KEPT: Kept["Reading"] = Kept(32)
_LONGEST_NAME = 400  # characters of a home's name or path in messages
_NAME = re.compile(r"[a-z][a-z0-9_]*/[a-z][a-z0-9_]*_[0-9]+")


@dataclass(frozen=True, eq=False)
class Home:
    """A home, read from its URDF.

    Attributes:
        name: the file's stem.
        path: the URDF.
        rooms: name -> room, in the order of the file.
        things: furniture and scenery, in the order of the file: the static nodes of scene graphs.
        structure: floors and walls.
        links: all of them with their shapes, as physics and cameras need them.
        files: the URDF and all that it names, as they were read.
        content: the sha256 of those files.
        catalog: the classes of things that it is read with: what is a receptacle, and what stands on it.
    """

    name: str
    path: Path
    rooms: dict[str, Room]
    things: tuple[Thing, ...]
    structure: tuple[Thing, ...]
    links: tuple[Link, ...]
    files: tuple[Path, ...]
    content: str
    catalog: Catalog = BENCHMARK

    @property
    def goto_rooms(self) -> tuple[str, ...]:
        """Rooms that robots can be sent to, in the catalogue's order of kinds, then of their numbers."""
        order = catalog.ROOM_KINDS
        rooms = [room for room in self.rooms if catalog.room_kind(room) in order]
        return tuple(sorted(rooms, key=lambda room: (order.index(catalog.room_kind(room)), len(room), room)))

    @cached_property
    def solids(self) -> tuple[Solid, ...]:
        """All solids except floors."""
        return tuple(
            solid for thing in self.structure + self.things if thing.class_name != "floor" for solid in thing.solids
        )

    @cached_property
    def bounds(self) -> tuple[Points, Points]:
        """Lower and upper corner (2,) of the floors."""
        corners = np.concatenate([floor for room in self.rooms.values() for floor in room.floors])
        return corners.min(axis=0), corners.max(axis=0)

    @cached_property
    def receptacles(self) -> dict[str, Thing]:
        """Name -> thing, for the things of the catalogue's receptacle classes that are solid."""
        known = self.catalog.receptacles
        return {thing.name: thing for thing in self.things if thing.class_name in known and thing.solids}


def home_names() -> list[str]:
    """Return the names of the homes that come with the package."""
    return sorted(path.stem for path in SCENES_DIR.glob("*.urdf"))


def home_path(name_or_path: str | Path) -> Path:
    """Return the URDF of a packaged home's name, or the path itself; ``generated-123`` is made at its first use.

    So is one that the user's cache has no more, or no longer whole, should its path there be given.

    Raises:
        HomeError: there is neither a home of this name nor such a file.
    """
    seed = generated_seed(name_or_path)
    if seed is not None:
        return generate_home(seed).resolve()
    packaged, path = SCENES_DIR / f"{name_or_path}.urdf", Path(str(name_or_path))
    try:
        found = next((file for file in (packaged, path) if file.exists() and not file.is_dir()), None)
        if found is not None and found.suffix == ".toml":
            raise HomeError(f"{found}: is a layout, no home yet; build it: chmarl-pb homes build {found}")
        if found is not None:
            return found.resolve()
    except (OSError, RuntimeError):  # too long a name, a loop of links
        pass
    raise HomeError(
        f"{str(name_or_path)[:_LONGEST_NAME]}: no such home; give a path to a home's URDF, generated-SEED or one of: "
        f"{', '.join(home_names())}"
    )


@dataclass(frozen=True, eq=False)
class Reading:
    """What a home's files gave.

    Attributes:
        path: the URDF.
        home: as far as it can be read; None if it has no floor, or is larger than a home can be.
        found: what is wrong with it; with errors, parts of it are missing.
    """

    path: Path
    home: Home | None
    found: Findings


def load_home(name_or_path: str | Path, known: Catalog = BENCHMARK) -> Home:
    """Read a home by name or path; while none of its files changes it is read once per process and catalogue.

    Args:
        name_or_path: of the home.
        known: the classes of things.

    Raises:
        HomeError: there is no such home, it is unsafe or larger than a home can be, or a part of it is broken: see
            :func:`chmarl_pb.homes.urdf.read_links`; a link name is against the convention, or a room has no floor.
    """
    reading = read_home(name_or_path, known)
    raise_first(reading.found.errors)
    assert reading.home is not None
    return reading.home


def read_home(name_or_path: str | Path, known: Catalog) -> Reading:
    """Read a home by name or path as far as that can be done, and list all that is wrong with its files.

    Raises:
        HomeError: there is no such home.
    """
    path = home_path(name_or_path)

    def read() -> tuple[Reading, tuple[Path, ...] | None]:
        reading = _read(path, known)
        if reading.home is None or reading.found.errors:
            return reading, None  # its files may be mended
        return reading, reading.home.files

    return _KEPT.get((path, known), path, read)


def _read(path: Path, known: Catalog) -> Reading:
    found = Findings(path)
    try:
        home = _home(path, found, known)
    except Refused as refused:
        found.error(*refused.args)
        home = None
    return Reading(path, home, found)


def _home(path: Path, found: Findings, known: Catalog) -> Home | None:
    source = Source(path)
    links = read_links(source, found)
    known = looks_in(known, (link.name for link in links))
    by_name = {link.name: link for link in links}
    found.locate(lambda name: middle_of(by_name[name]) if name in by_name else None)
    links = tuple(link for link in links if link.visuals or link.collisions)
    links = tuple(link for link in links if _is_well_named(link.name, found))
    things = [Thing(link.name, link.frame, link.solids) for link in links]
    rooms = rooms_of(things, found)
    things = [thing for thing in things if thing.room in rooms]
    if not rooms:
        return None
    structure = tuple(thing for thing in things if thing.class_name in catalog.STRUCTURE)
    furniture = tuple(thing for thing in things if thing.class_name not in catalog.STRUCTURE)
    links = tuple(link for link in links if catalog.room_of(link.name) in rooms)
    return Home(path.stem, path, rooms, furniture, structure, links, source.files, source.content, known)


def middle_of(link: Link) -> tuple[float, ...]:
    """Return the middle (x, y, z) of a link's solids; of its frame when it has none."""
    if not link.solids:
        return tuple(link.frame[:3, 3].tolist())
    low, high = bounds(link.solids)
    return tuple(((low + high) / 2).tolist())


def _is_well_named(name: str, found: Findings) -> bool:
    good = _NAME.fullmatch(name) is not None
    if not good:
        found.error(
            "a link with geometry is named <room>/<class>_<number>; call it e.g. kitchen/stove_1, in lower case", name
        )
    return good
