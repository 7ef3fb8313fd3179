"""What is odd about a home that can be read: names that nothing knows, and things that stand where none should.

Each becomes a warning: such a home can be played, but hardly as its maker meant it.
"""

from collections.abc import Iterator, Sequence
from difflib import get_close_matches
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.problem import Findings
from chmarl_pb.homes.rooms import Room, Thing
from chmarl_pb.homes.solids import Points, Solid, bounds, inside, overlap
from chmarl_pb.homes.urdf import Link

_DEEP = 0.05  # metres: how far things may be inside one another, as a chair's back and a table's edge are
_MOST_PAIRS = 1000  # of solids inside one another that are measured
_HIDDEN = 0.04  # square metres of a mesh that may be level and inside its hull
_GAP = 0.05  # metres between a thing and what carries it
_OFF = 0.3  # metres between the middles of what is seen and of what is solid, beside half of their size
_UNREAD = {
    "colours": "it is white, for the colours of its mesh file are not read; give it a <material> with a <color>",
    "up axis": "its mesh file says that another axis than z is up, which is not read; export it with z up",
}
_LARGER = 2.0  # times as large as what is solid: what is seen, or the other way round
_AT_WALLS = ("picture", "mirror", "window", "tv", "radiator", "towel_rack", "door")  # may be let into a wall


def find_oddities(home: Home, found: Findings) -> None:
    """Add a warning for everything about a home that looks like a mistake."""
    rooms, furniture = home.catalog.rooms, {**home.catalog.receptacles, **home.catalog.scenery}
    for room in home.rooms:
        if catalog.room_kind(room) not in rooms:
            name = f"{room}/floor_1"
            found.warning(
                f"room {room!r} is of no known kind, so robots cannot be sent there; "
                f"{_advice(catalog.room_kind(room), rooms)}", name,
            )  # fmt: skip
    for thing in home.things:
        if thing.class_name not in furniture:
            found.warning(
                f"class {thing.class_name!r} is not known, so it is scenery without a name; "
                f"{_advice(thing.class_name, furniture)}", thing.name,
            )  # fmt: skip
        _check_room(home, thing, found)
    for link in home.links:
        _check_visuals(link, found)
        _check_hulls(link, found)
    _check_neighbours(home, found)


def nearest_name(name: str, known: dict[str, catalog.ThingClass]) -> str | None:
    """Return the class that a name most likely means: by another name of its own, else by its letters."""
    words = {word.replace(" ", "_"): row.name for row in known.values() for word in (row.name, *row.synonyms)}
    close = get_close_matches(name, words, n=1, cutoff=0.6)
    return words[close[0]] if close else None


def _advice(name: str, known: dict[str, catalog.ThingClass]) -> str:
    nearest = nearest_name(name, known)
    if nearest is None:
        return f"use one that the catalogue knows, as {', '.join(list(known)[:4])}"
    return f"call it {nearest!r} if that is what it is"


def _check_room(home: Home, thing: Thing, found: Findings) -> None:
    """Compare the room in a thing's name with the floor that its middle is over."""
    if _covers(home.rooms[thing.room], thing.centre[None]):
        return
    other = next((name for name, room in home.rooms.items() if _covers(room, thing.centre[None])), None)
    if other is not None and not _at_edge(home, thing):
        found.warning(f"its name says {thing.room!r}, but it stands in {other!r}; rename or move it", thing.name)
    elif other is None and not _at_edge(home, thing):
        found.warning("it stands outside of all rooms; move it onto a floor", thing.name)


def _at_edge(home: Home, thing: Thing) -> bool:
    """Return whether a thing reaches over the floor that it belongs to, as a picture on the wall does."""
    low, high = thing.centre - 0.15, thing.centre + 0.15
    points = np.stack(np.meshgrid(*zip(low, high, strict=True)), axis=-1).reshape(-1, 2)
    return _covers(home.rooms[thing.room], points)


def _covers(room: Room, points: Points) -> bool:
    """Return whether one of some points (n, 2) lies on a room's floor."""
    return any(inside(floor, points).any() for floor in room.floors)


def _check_visuals(link: Link, found: Findings) -> None:
    """Compare what cameras see of a link with what is solid."""
    if not link.visuals:
        if any(problem.link == link.name for problem in found.errors):  # it may have some, which are broken
            return
        found.warning("it has no <visual>, so cameras see its collision shapes, in white; add one", link.name)
        return
    if all(shape.colour is not None and shape.colour[3] == 0 for shape in link.visuals):
        found.warning("all its visuals are transparent, so no camera sees it; set alpha to 1", link.name)
    for number, shape in enumerate(link.visuals, start=1):
        for unread in () if shape.mesh is None else shape.mesh.unread:
            if unread != "colours" or shape.colour is None:
                found.warning(f"visual {number}: {_UNREAD[unread]}", link.name)
    if link.solids:
        seen = np.concatenate([shape.points(link.frame) for shape in link.visuals])
        low, high = seen.min(axis=0), seen.max(axis=0)
        bottom, top = bounds(link.solids)
        apart = np.maximum(low - top, bottom - high).max()
        if apart > 0.02:
            found.warning(
                f"what cameras see lies {apart:.2f} m beside what is solid; give <visual> and <collision> one origin",
                link.name,
            )
        seen_size, size = np.linalg.norm(high - low), np.linalg.norm(top - bottom)
        if not size / _LARGER < seen_size < size * _LARGER:
            found.warning(
                f"what cameras see measures {seen_size:.3g} m from corner to corner, what is solid {size:.3g} m; a "
                "URDF's unit is the metre, so give its <visual> the right scale", link.name,
            )  # fmt: skip


def _check_hulls(link: Link, found: Findings) -> None:
    """Compare meshes of collisions with their convex hulls, which are what is solid: are level parts inside?"""
    for number, (shape, solid) in enumerate(zip(link.collisions, link.solids, strict=True), start=1):
        if shape.mesh is None:
            continue
        corners = shape.triangles(link.frame)
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / 2
        areas = np.linalg.norm(normals, axis=1)
        level = normals[:, 2] > 0.99 * np.maximum(areas, 1e-12)
        middles = corners.mean(axis=1)
        hidden = level & ((middles @ solid.planes[:, :3].T + solid.planes[:, 3]).max(axis=1) < -0.02)
        if areas[hidden].sum() > max(_HIDDEN, areas[level].sum() / 2):
            height = float(np.median(middles[hidden, 2]))
            found.warning(
                f"collision {number}: a level part of {areas[hidden].sum():.2f} m2 at {height:.2f} m lies inside the "
                "convex hull of its mesh, all of which is solid; build it of several convex meshes or boxes", link.name,
            )  # fmt: skip


def _check_neighbours(home: Home, found: Findings) -> None:
    """Look for things inside one another or inside walls, and for things that nothing carries."""
    solids, owners = _all_solids(home)
    if not solids:
        return
    lows = np.array([[*solid.low, solid.bottom] for solid in solids])
    highs = np.array([[*solid.high, solid.top] for solid in solids])
    deepest: dict[str, tuple[float, str]] = {}
    for one, other in islice(_meeting(lows, highs, owners), _MOST_PAIRS):
        name, depth = owners[one].name, _overlap(solids[one], solids[other])
        deepest[name] = max(deepest.get(name, (_DEEP, "")), (depth, owners[other].name))
    for name, (depth, other_name) in deepest.items():
        if other_name:
            where = "in the wall" if catalog.class_of(other_name) == "wall" else "inside"
            found.warning(f"it is {depth:.2f} m deep {where} {other_name!r}; move one of them", name)
    for thing in home.things:
        if thing.solids and not _is_carried(thing, lows, highs, owners):
            bottom = min(solid.bottom for solid in thing.solids)
            found.warning(
                f"nothing carries it: its bottom is {bottom:.2f} m above the floor; lower it, or put it at a wall",
                thing.name,
            )


def _all_solids(home: Home) -> tuple[list[Solid], list[Thing]]:
    pairs = [
        (solid, thing)
        for thing in home.things + home.structure
        if thing.class_name != "floor"
        for solid in thing.solids
    ]
    return [solid for solid, _ in pairs], [thing for _, thing in pairs]


def _meeting(lows: Points, highs: Points, owners: Sequence[Thing]) -> Iterator[tuple[int, int]]:
    """Yield pairs of solids of two things whose boxes are inside one another, the smaller first, but a wall last."""
    for number, thing in enumerate(owners):
        if thing.class_name == "wall":
            continue
        deep: NDArray[np.bool_] = (
            np.minimum(highs, highs[number]) - np.maximum(lows, lows[number]) > _DEEP
        ).all(axis=1)  # fmt: skip
        for other in np.flatnonzero(deep).tolist():
            owner = owners[other]
            wall = owner.class_name == "wall"
            if owner is thing or (other < number and not wall) or (wall and thing.class_name in _AT_WALLS):
                continue
            larger = np.prod(highs[number] - lows[number]) > np.prod(highs[other] - lows[other])
            yield (other, number) if larger and not wall else (number, other)


def _overlap(one: Solid, other: Solid) -> float:
    """Return how far one has to be moved at most to be clear of another, by the axes of their outlines and upwards."""
    return min(min(one.top, other.top) - max(one.bottom, other.bottom), overlap(one.polygon, other.polygon))


def _is_carried(thing: Thing, lows: Points, highs: Points, owners: Sequence[Thing]) -> bool:
    """Return whether a thing stands on the floor or on another, hangs at a wall, or touches something else."""
    low, high = bounds(thing.solids)
    if low[2] <= _GAP:
        return True
    touches = (np.minimum(highs, high + _GAP) > np.maximum(lows, low - _GAP)).all(axis=1)
    return any(owners[number] is not thing for number in np.flatnonzero(touches).tolist())
