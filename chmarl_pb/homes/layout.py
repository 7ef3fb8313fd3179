"""Layout files: a home as rooms, doors and furniture, in TOML (format: docs/homes.md)."""

import math
import re
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard, cast

from chmarl_pb.catalog import ROOMS, room_kind
from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.homes.furniture import Model, load_model
from chmarl_pb.homes.source import read_regular
from chmarl_pb.homes.walls import Gap, Rect, Wall, boundary, gap_in

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found, unused-ignore]

Colour = tuple[float, float, float]
"""Red, green, blue in 0..1."""

GRID = 0.25
"""Rooms lie on multiples of this length, in metres: the humanoid's lattice."""

SIDES = {"north": 270.0, "west": 0.0, "south": 90.0, "east": 180.0}
"""Yaw in degrees of furniture that stands with its back against a room's side."""

_TOLERANCE = 0.01
_LARGEST = 1e6  # of any number
_MOST_BYTES = 2**20
_MOST_RECTS, _MOST_DOORS, _MOST_FURNITURE = 64, 64, 1000
_LONGEST_PROBLEM = 500  # characters


@dataclass(frozen=True)
class Room:
    """A room: one or several rectangles up to the middle of its walls (metres), with the colours of floor and walls."""

    name: str
    rects: tuple[Rect, ...]
    floor: Colour
    wall: Colour


@dataclass(frozen=True)
class Door:
    """A doorway without a leaf: the rooms it joins, its centre on their shared wall and its width (metres)."""

    between: tuple[str, str]
    position: tuple[float, float]
    width: float


@dataclass(frozen=True)
class Furniture:
    """A piece of furniture: its room, model, pose (metres, degrees about z) and colours (None: the model's own)."""

    room: str
    model: str
    position: tuple[float, float, float]
    yaw: float
    color: Colour | None = None
    secondary: Colour | None = None


@dataclass(frozen=True)
class Layout:
    """A whole home. Lengths in metres, x to the east, y to the north, floors at z = 0."""

    name: str
    wall_height: float
    wall_thickness: float
    rooms: tuple[Room, ...]
    doors: tuple[Door, ...]
    furniture: tuple[Furniture, ...]

    @property
    def rects(self) -> dict[str, tuple[Rect, ...]]:
        """The rectangles of each room."""
        return {room.name: room.rects for room in self.rooms}

    @property
    def gaps(self) -> list[Gap]:
        """The doorways in the walls."""
        walls = boundary(self.rects)
        found = (gap_in(wall, door.between, door.position, door.width) for door in self.doors for wall in walls)
        return [gap for gap in found if gap]


class _Table:
    """One table of a layout file: typed access that names the file and the table in every error."""

    def __init__(self, values: Any, place: str, palette: Mapping[str, Any] | None = None):
        self.place = place
        self.palette = palette or {}
        if not isinstance(values, dict):
            raise self.error("must be a table of keys and values")
        self.values = values

    def error(self, problem: str) -> HomeError:
        cut = "..." if len(problem) > _LONGEST_PROBLEM else ""
        return HomeError(f"{self.place}: {problem[:_LONGEST_PROBLEM]}{cut}")

    def allow(self, keys: str) -> None:
        """Refuse keys that are not in a list of words."""
        for key in self.values:
            if key not in keys.split():
                raise self.error(f"unknown key {key!r}; known keys: {', '.join(keys.split())}")

    def text(self, key: str, pattern: str = "[a-z][a-z0-9_]*") -> str:
        value = self.values.get(key)
        if not isinstance(value, str) or not re.fullmatch(pattern, value):
            raise self.error(f"{key!r} must be a string that matches {pattern}, got {value!r}")
        return value

    def numbers(self, key: str, count: int, default: Sequence[float] | None = None) -> tuple[float, ...]:
        value = self.values.get(key, default)
        if not isinstance(value, (list, tuple)) or len(value) != count or not all(map(_is_number, value)):
            raise self.error(f"{key!r} must be a list of {count} numbers, got {value!r}")
        return tuple(float(number) for number in value)

    def number(self, key: str, default: float | None = None, low: float = -math.inf) -> float:
        value = self.values.get(key, default)
        if not _is_number(value) or value < low:
            least = f" of at least {low}" if low > -math.inf else ""
            raise self.error(f"{key!r} must be a number{least}, got {value!r}")
        return float(value)

    def colour(self, key: str) -> Colour:
        """Return a colour, written as ``#rrggbb`` or as a name from the palette."""
        value = self.values.get(key)
        digits = self.palette.get(value, value) if isinstance(value, str) else value
        if not isinstance(digits, str) or not re.fullmatch("#[0-9a-fA-F]{6}", digits):
            names = ", ".join(self.palette) or "none"
            raise self.error(f"{key!r} must be a colour '#rrggbb' or a name from the palette ({names}), got {value!r}")
        red, green, blue = (int(digits[i : i + 2], 16) / 255 for i in (1, 3, 5))
        return red, green, blue

    def tables(self, key: str, most: int) -> list["_Table"]:
        rows = self.values.get(key, [])
        if not isinstance(rows, list):
            raise self.error(f"{key!r} must be an array of tables, got {rows!r}")
        if len(rows) > most:
            raise self.error(f"{len(rows):,} tables {key!r}, at most {most:,} are read; remove some")
        places = [f"{self.place}: {key} {number}" for number in range(1, len(rows) + 1)]
        return [_Table(row, place, self.palette) for row, place in zip(rows, places, strict=True)]


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _LARGEST  # not NaN


def load_layout(path: str | Path) -> Layout:
    """Read and check a layout file.

    Raises:
        HomeError: the file cannot be read, or a table or value in it cannot be used; the message names it.
    """
    try:
        values = tomllib.loads(read_regular(Path(path), _MOST_BYTES).decode("utf-8"))
    except (ValueError, RecursionError) as problem:  # not a file of such a size, not UTF-8, not TOML, tables in tables
        raise HomeError(f"{path}: cannot be read as TOML: {problem}") from problem
    top = _Table(values, str(path), _Table(values.get("palette", {}), f"{path}: palette").values)
    top.allow("name wall_height wall_thickness palette room door furniture")
    thickness = top.number("wall_thickness", 0.1, low=0.02)
    rooms = _read_rooms(top)
    walls = boundary({room.name: room.rects for room in rooms})
    doors = tuple(_read_door(table, rooms, walls) for table in top.tables("door", _MOST_DOORS))
    furniture = tuple(_read_furniture(table, rooms, thickness) for table in top.tables("furniture", _MOST_FURNITURE))
    return Layout(top.text("name"), top.number("wall_height", 2.5, low=1.0), thickness, rooms, doors, furniture)


def _read_rooms(top: _Table) -> tuple[Room, ...]:
    rooms: list[Room] = []
    for table in top.tables("room", _MOST_RECTS):
        room = _read_room(table)
        for other in rooms:
            if other.name == room.name:
                raise table.error(f"a second room named {room.name!r}; number them: {room.name}_2")
            if any(_overlap(one, two) for one in room.rects for two in other.rects):
                raise table.error(f"{room.name!r} overlaps {other.name!r}; move or shrink a rect")
        rooms.append(room)
    if sum(len(room.rects) for room in rooms) > _MOST_RECTS:
        raise top.error(f"the rooms have more than {_MOST_RECTS} rectangles; join some")
    if not rooms:
        raise top.error("no rooms; add at least one room = [{name = ..., rect = ...}]")
    return tuple(rooms)


def _read_room(table: _Table) -> Room:
    table.allow("name rect rects floor wall")
    name = table.text("name")
    if room_kind(name) not in ROOMS:
        raise table.error(f"unknown room kind {room_kind(name)!r}; known kinds: {', '.join(ROOMS)}")
    if ("rect" in table.values) == ("rects" in table.values):
        raise table.error(f"{name!r} needs either 'rect' or 'rects'")
    rows = table.values["rects"] if "rects" in table.values else [table.values["rect"]]
    if not isinstance(rows, list) or not 0 < len(rows) <= _MOST_RECTS:
        raise table.error(f"'rects' must be a list of 1 to {_MOST_RECTS} rectangles, got {rows!r}")
    rects = tuple(_read_rect(_Table({"rect": row}, table.place)) for row in rows)
    if any(_overlap(one, two) for i, one in enumerate(rects) for two in rects[:i]):
        raise table.error(f"two rectangles of {name!r} overlap; let them touch")
    return Room(name, rects, table.colour("floor"), table.colour("wall"))


def _read_rect(table: _Table) -> Rect:
    x0, y0, x1, y1 = table.numbers("rect", 4)
    if x0 >= x1 or y0 >= y1:
        raise table.error(f"'rect' must be [low x, low y, high x, high y], got {[x0, y0, x1, y1]}")
    if any(edge % GRID for edge in (x0, y0, x1, y1)):
        raise table.error(f"the edges of a 'rect' must be multiples of {GRID} m, got {[x0, y0, x1, y1]}")
    return x0, y0, x1, y1


def _overlap(one: Rect, two: Rect) -> bool:
    return one[0] < two[2] and two[0] < one[2] and one[1] < two[3] and two[1] < one[3]


def _read_door(table: _Table, rooms: Sequence[Room], walls: Sequence[Wall]) -> Door:
    table.allow("between position width")
    between = table.values.get("between")
    names = [room.name for room in rooms]
    if not isinstance(between, list) or len(between) != 2 or not all(name in names for name in between):
        raise table.error(f"'between' must name two rooms of {', '.join(names)}, got {between!r}")
    x, y = table.numbers("position", 2)
    door = Door((between[0], between[1]), (x, y), table.number("width", 1.0, low=1.0))
    if not any(gap_in(wall, door.between, door.position, door.width) for wall in walls):
        raise table.error(f"[{x}, {y}] with width {door.width} is not on a wall that {' and '.join(between)} share")
    return door


def _read_furniture(table: _Table, rooms: Sequence[Room], thickness: float) -> Furniture:
    table.allow("room model position yaw z against at gap color secondary")
    name, model_name = table.text("room"), table.text("model")
    room = next((room for room in rooms if room.name == name), None)
    if room is None:
        raise table.error(f"unknown room {name!r}; rooms: {', '.join(room.name for room in rooms)}")
    try:
        model = load_model(model_name)
    except AssetError as problem:
        raise table.error(f"unknown model {model_name!r}: {problem}") from problem
    x, y, yaw = _read_against(table, room, model, thickness) if "against" in table.values else _read_pose(table)
    if not _is_inside(model, x, y, yaw, room, thickness / 2 - _TOLERANCE):
        raise table.error(f"{model_name} at [{x:.3f}, {y:.3f}] with yaw {yaw:g} is not wholly inside {name!r}; move it")
    color, secondary = (table.colour(key) if key in table.values else None for key in ("color", "secondary"))
    return Furniture(name, model_name, (x, y, table.number("z", 0.0, low=0.0)), yaw, color, secondary)


def _read_pose(table: _Table) -> tuple[float, float, float]:
    """Return the free pose of a piece of furniture: x, y in metres, yaw in degrees."""
    for key in ("at", "gap"):
        if key in table.values:
            raise table.error(f"{key!r} needs 'against'; use 'position' and 'yaw' for a free pose")
    x, y = table.numbers("position", 2)
    return x, y, table.number("yaw", 0.0)


def _read_against(table: _Table, room: Room, model: Model, thickness: float) -> tuple[float, float, float]:
    """Return the pose of furniture with its back to a wall: ``against`` a side, ``at`` a coordinate along it."""
    side = table.text("against", "|".join(SIDES))
    if "position" in table.values or "yaw" in table.values:
        raise table.error("'against' with 'at' replaces 'position' and 'yaw'; give one or the other")
    at = table.number("at")
    axis = 0 if side in ("north", "south") else 1
    facing = [rect for rect in room.rects if rect[axis] <= at <= rect[axis + 2]]
    if not facing:
        raise table.error(f"no {side} wall of {room.name!r} at {at}")
    sign = 1 if side in ("north", "east") else -1
    edge = max(sign * rect[1 - axis + (2 if sign > 0 else 0)] for rect in facing)
    back = edge - thickness / 2 - table.number("gap", 0.0, low=0.0)
    across = sign * (back + float(model.low[0]))
    return (at, across, SIDES[side]) if axis == 0 else (across, at, SIDES[side])


def _is_inside(model: Model, x: float, y: float, yaw: float, room: Room, margin: float) -> bool:
    """Tell whether a model's footprint lies in a room and keeps ``margin`` metres off its outline."""
    cos, sin = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
    low, high = cast(list[float], model.low.tolist()), cast(list[float], model.high.tolist())
    corners = [(x + cos * u - sin * v, y + sin * u + cos * v) for u in (low[0], high[0]) for v in (low[1], high[1])]
    around = [(cx + dx, cy + dy) for cx, cy in corners for dx in (-margin, margin) for dy in (-margin, margin)]
    return all(any(r[0] <= px <= r[2] and r[1] <= py <= r[3] for r in room.rects) for px, py in around)
