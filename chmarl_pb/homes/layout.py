"""Layout files: a home as rooms, doors and furniture, in TOML (format: docs/homes.md)."""

import io
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

from PIL import Image

from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.catalog import BENCHMARK, Catalog, room_kind
from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.homes.furniture import Model, load_model
from chmarl_pb.homes.layout_file import Colour, Table, read_each, read_tables, refuse
from chmarl_pb.homes.textures import textures
from chmarl_pb.homes.walls import Gap, Rect, Wall, boundary, gap_in
from chmarl_pb.reading import read_regular

GRID = 0.25
"""Rooms lie on multiples of this length, in metres: the humanoid's lattice."""

SIDES = {"north": 270.0, "west": 0.0, "south": 90.0, "east": 180.0}
"""Yaw in degrees of furniture that stands with its back against a room's side."""

STARTER = Path(__file__).with_name("starter.toml")
"""A small layout to begin with."""

STYLES = {"starter": STARTER, **{file.stem: file for file in sorted((SCENES_DIR / "examples").glob("*.toml"))}}
"""Layouts to begin with, by name: the starter and the finished examples."""

SCHEMA = Path(__file__).with_name("layout.schema.json")
"""The JSON Schema of layouts, for editors."""

_MODEL = r"[a-z][a-z0-9_]*|[^\x00-\x1f]{1,300}\.urdf"
_LOWEST_LINTEL = 2.0  # metres: robots pass below
_TOLERANCE = 0.01
_MOST_PICTURE_BYTES = 2**22
_MOST_RECTS, _MOST_DOORS, _MOST_FURNITURE = 64, 64, 1000


@dataclass(frozen=True)
class Room:
    """A room: one or several rectangles up to the middle of its walls (metres), and how floor and walls look.

    Attributes:
        name: kind and number.
        rects: its rectangles.
        floor: colour of the floor.
        wall: colour of the walls.
        floor_texture: picture of one square metre that the colour tints; None: plain.
        wall_texture: the same of the walls.
    """

    name: str
    rects: tuple[Rect, ...]
    floor: Colour
    wall: Colour
    floor_texture: Path | None = None
    wall_texture: Path | None = None


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
    """A whole home. Lengths in metres, x to the east, y to the north, floors at z = 0.

    ``door_height`` None: doorways have no top; ``object_looks`` None: objects look as in the benchmark's homes.
    """

    name: str
    wall_height: float
    wall_thickness: float
    rooms: tuple[Room, ...]
    doors: tuple[Door, ...]
    furniture: tuple[Furniture, ...]
    door_height: float | None = None
    catalog: Catalog = BENCHMARK
    object_looks: int | None = None

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


def load_layout(path: str | Path, known: Catalog = BENCHMARK) -> Layout:
    """Read and check a layout file, whose furniture is of the classes of a catalogue.

    Raises:
        HomeError: the file cannot be read, or a table or value in it cannot be used; the message names it.
    """
    top = read_tables(Path(path))
    problems: list[HomeError] = []
    names, heights = read_each([top], _read_name, problems), read_each([top], _read_walls, problems)
    looks = read_each([top], _read_looks, problems)
    read_each([top], _check_palette, problems)
    rooms = _read_rooms(top, problems)
    refuse(problems)  # without its rooms, nothing else can be judged
    (name,), ((height, thickness, lintel),) = names, heights
    walls = boundary({room.name: room.rects for room in rooms})
    doors = read_each(top.tables("door", _MOST_DOORS), lambda table: _read_door(table, rooms, walls), problems)
    pieces = top.tables("furniture", _MOST_FURNITURE)
    own = Path(path).parent, known
    furniture = read_each(pieces, lambda table: _read_furniture(table, rooms, thickness, *own), problems)
    refuse(problems)
    return Layout(name, height, thickness, rooms, doors, furniture, lintel, known, looks[0])


def _read_name(top: Table) -> str:
    top.allow("name wall_height wall_thickness door_height object_looks palette room door furniture")
    return top.text("name", "[a-z][a-z0-9_-]*")


def _read_walls(top: Table) -> tuple[float, float, float | None]:
    """Return height and thickness of the walls, and the height of the doorways if they are lower."""
    height, thickness = top.number("wall_height", 2.5, low=1.0), top.number("wall_thickness", 0.1, low=0.02)
    lintel = top.number("door_height", low=_LOWEST_LINTEL) if "door_height" in top.values else None
    if lintel is not None and lintel >= height:
        raise top.error(f"'door_height' {lintel:g} is not below 'wall_height' {height:g}", "door_height")
    return height, thickness, lintel


def _read_looks(top: Table) -> int | None:
    return int(top.number("object_looks", low=0)) if "object_looks" in top.values else None


def _check_palette(top: Table) -> None:
    for name in top.palette:
        Table(top.palette, top.file, ("palette",)).colour(name)


def _read_rooms(top: Table, problems: list[HomeError]) -> tuple[Room, ...]:
    rooms: list[Room] = []

    def read(table: Table) -> None:
        room = _read_room(table)
        for other in rooms:
            if other.name == room.name:
                raise table.error(f"a second room named {room.name!r}; number them: {room.name}_2", "name")
            if any(_overlap(one, two) for one in room.rects for two in other.rects):
                raise table.error(f"{room.name!r} overlaps {other.name!r}; move or shrink a rect")
        rooms.append(room)

    tables = top.tables("room", _MOST_RECTS)
    read_each(tables, read, problems)
    if sum(len(room.rects) for room in rooms) > _MOST_RECTS:
        problems.append(top.error(f"the rooms have more than {_MOST_RECTS} rectangles; join some"))
    if not tables:
        problems.append(top.error("no rooms; add at least one room = [{name = ..., rect = ...}]"))
    return tuple(rooms)


def _read_room(table: Table) -> Room:
    table.allow("name rect rects floor wall floor_texture wall_texture")
    name = table.text("name")
    if room_kind(name) not in BENCHMARK.rooms:
        raise table.error(f"unknown room kind {room_kind(name)!r}; known kinds: {', '.join(BENCHMARK.rooms)}", "name")
    if ("rect" in table.values) == ("rects" in table.values):
        raise table.error(f"{name!r} needs either 'rect' or 'rects'")
    rows = table.values["rects"] if "rects" in table.values else [table.values["rect"]]
    if not isinstance(rows, list) or not 0 < len(rows) <= _MOST_RECTS:
        raise table.error(f"'rects' must be a list of 1 to {_MOST_RECTS} rectangles, got {rows!r}")
    rects = tuple(_read_rect(Table({"rect": row}, table.file, table.place)) for row in rows)
    if any(_overlap(one, two) for i, one in enumerate(rects) for two in rects[:i]):
        raise table.error(f"two rectangles of {name!r} overlap; let them touch")
    looks = (_read_texture(table, key) for key in ("floor_texture", "wall_texture"))
    return Room(name, rects, table.colour("floor"), table.colour("wall"), *looks)


def _read_texture(table: Table, key: str) -> Path | None:
    """Return the picture of a name of the package's, or of a path as seen from the layout."""
    if key not in table.values:
        return None
    name, known = table.text(key, r"\S.*"), textures()
    if name in known:
        return known[name]
    path = table.file.path.parent / name
    if path.suffix.lower() not in (".png", ".jpg", ".jpeg"):
        raise table.error(f"{key!r} must be one of {', '.join(known)} or the path of a PNG or JPEG, got {name!r}", key)
    try:
        Image.open(io.BytesIO(read_regular(path, _MOST_PICTURE_BYTES))).verify()
    except (ValueError, OSError, SyntaxError) as problem:
        raise table.error(f"{key!r}: {name!r} cannot be read as a picture: {problem}", key) from problem
    return path


def _read_rect(table: Table) -> Rect:
    x0, y0, x1, y1 = table.numbers("rect", 4)
    if x0 >= x1 or y0 >= y1:
        raise table.error(f"'rect' must be [low x, low y, high x, high y], got {[x0, y0, x1, y1]}")
    if any(edge % GRID for edge in (x0, y0, x1, y1)):
        raise table.error(f"the edges of a 'rect' must be multiples of {GRID} m, got {[x0, y0, x1, y1]}")
    return x0, y0, x1, y1


def _overlap(one: Rect, two: Rect) -> bool:
    return one[0] < two[2] and two[0] < one[2] and one[1] < two[3] and two[1] < one[3]


def _read_door(table: Table, rooms: Sequence[Room], walls: Sequence[Wall]) -> Door:
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


def _read_furniture(table: Table, rooms: Sequence[Room], thickness: float, folder: Path, known: Catalog) -> Furniture:
    table.allow("room model position yaw z against at gap color secondary")
    name, model_name = table.text("room"), table.text("model", _MODEL)
    room = next((room for room in rooms if room.name == name), None)
    if room is None:
        raise table.error(f"unknown room {name!r}; rooms: {', '.join(room.name for room in rooms)}", "room")
    if model_name.endswith(".urdf"):  # the user's own
        model_name = str((folder / model_name).resolve())
    try:
        model = load_model(model_name, known)
    except AssetError as problem:
        raise table.error(f"unknown model {model_name!r}: {problem}", "model") from problem
    x, y, yaw = _read_against(table, room, model, thickness) if "against" in table.values else _read_pose(table)
    if not _is_inside(model, x, y, yaw, room, thickness / 2 - _TOLERANCE):
        raise table.error(f"{model_name} at [{x:.3f}, {y:.3f}] with yaw {yaw:g} is not wholly inside {name!r}; move it")
    color, secondary = (table.colour(key) if key in table.values else None for key in ("color", "secondary"))
    return Furniture(name, model_name, (x, y, table.number("z", 0.0, low=0.0)), yaw, color, secondary)


def _read_pose(table: Table) -> tuple[float, float, float]:
    """Return the free pose of a piece of furniture: x, y in metres, yaw in degrees."""
    for key in ("at", "gap"):
        if key in table.values:
            raise table.error(f"{key!r} needs 'against'; use 'position' and 'yaw' for a free pose")
    x, y = table.numbers("position", 2)
    return x, y, table.number("yaw", 0.0)


def _read_against(table: Table, room: Room, model: Model, thickness: float) -> tuple[float, float, float]:
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
