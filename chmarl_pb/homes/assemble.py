"""Build a home's URDF from its layout: floors, walls and furniture as links fixed to the root link ``home``."""

import math
import re
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import lru_cache
from os.path import basename
from pathlib import Path
from typing import Any

import numpy as np
import yourdfpy

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import OptionError
from chmarl_pb.files import check_apart, check_ending, replacing
from chmarl_pb.homes.furniture import Array, load_model
from chmarl_pb.homes.layout import Furniture, Layout, Room, load_layout
from chmarl_pb.homes.layout_file import Colour
from chmarl_pb.homes.object_looks import LINK as LOOKS_LINK
from chmarl_pb.homes.textures import textured_box
from chmarl_pb.homes.urdf_lines import urdf_bytes
from chmarl_pb.homes.walls import Rect, Wall, lintels, pieces
from chmarl_pb.reading import read_regular

ROOT = "home"
FLOOR_THICKNESS = 0.1
JAMB = (0.03, 0.02)
"""Door trim: its width along the wall and how far it stands out on both sides, in metres."""

SKIRTING = (0.012, 0.1)
"""Depth and height of the boards along the foot of walls, in metres."""

SKIRTING_SHADE = 0.78
"""Brightness of the skirting against its wall: darker, so that its narrow top does not glitter in small pictures."""

TRIM: Colour = (0.93, 0.91, 0.86)
MESHES = "meshes"
#: How the URDF of a layout begins, whichever version has built it, each of its joints, and all lines after the first.
_BUILT = re.compile(
    r"<\?xml version='1\.0' encoding='utf-8'\?>\n<robot name=\"[^\"]*\">\n  <link name=\"home\">\n    <inertial>\n"
)
_FIXED = re.compile(
    r'^  <joint name="fix ([^"]+)" type="fixed">\n    <parent link="home" />\n    <child link="\1" />\n', re.MULTILINE
)
_LINE = re.compile(
    r" *</?(?:robot|link|inertial|mass|inertia|visual|collision|geometry|box|cylinder|sphere|mesh|origin|material|"
    r'color|joint|parent|child)(?: [a-z]+="[^"]*")*(?: /)?>'
)


def build_home(layout_path: str | Path, out_path: str | Path | None = None, known: Catalog = BENCHMARK) -> Path:
    """Build the URDF of a layout file, with its meshes beside it, and return its path.

    Args:
        layout_path: the layout (TOML).
        out_path: the URDF to write; by default the layout's path with the suffix ``.urdf``.
        known: the classes of things.

    Raises:
        HomeError: the layout cannot be used.
        OptionError: the URDF's name does not end in ``.urdf``, or is the layout's; a file that no layout was built to
            is there by the URDF's name, which was not given, or by that of one of its meshes.
        WriteError: the files cannot be written.
    """
    layout = load_layout(layout_path, known)
    path = Path(out_path) if out_path else Path(layout_path).with_suffix(".urdf")
    check_ending(path, ".urdf")
    check_apart(path, [Path(layout_path)])
    files = home_files(layout, path.name)
    _check_built(path, files, named=bool(out_path))
    return write_files(files, path.parent)


def _check_built(path: Path, files: Mapping[Path, bytes], named: bool) -> None:
    """Refuse to write over files that were not built from layouts.

    Args:
        path: the URDF.
        files: to write, by their paths in its folder.
        named: whether the URDF was asked for by its name.
    """
    other = [file for file, content in files.items() if _differs(path.parent / file, content)]
    if Path(path.name) in other and not named and not _is_built(path):
        raise OptionError(
            f"{path} is there already and was not built from a layout; name another file by --out (this one to write "
            "over it), or move it away"
        )
    meshes = {file for file in other if file != Path(path.name)}
    built = filter(_is_built, path.parent.glob("*.urdf")) if meshes else ()
    for urdf in built:  # homes in one folder share their meshes
        meshes -= {Path(name) for name in re.findall(r'<mesh filename="([^"]+)"', urdf.read_text(encoding="utf-8"))}
    if meshes:
        raise OptionError(
            f"{path.parent / min(meshes)} is there already, differs from what the home needs and is of no home that "
            "was built there; build into another folder by --out, or move it away"
        )


def _differs(path: Path, content: bytes) -> bool:
    """Return whether something is there that is no empty file, and no file of this content."""
    try:
        return read_regular(path) not in (b"", content)
    except ValueError:
        return path.exists()


def _is_built(path: Path) -> bool:
    """Return whether a URDF has the lines that :func:`write_home` writes, and all of its joints."""
    try:
        text = read_regular(path).decode().replace("\r\n", "\n")  # as a checkout on Windows may have it
    except ValueError:
        return False
    joints = len(_FIXED.findall(text))
    plain = _BUILT.match(text) is not None and all(map(_LINE.fullmatch, text.splitlines()[1:]))
    return plain and joints == text.count("<joint") > 0


def write_home(layout: Layout, path: Path) -> Path:
    """Write the URDF of a layout and the meshes that it names into ``meshes`` beside it."""
    return write_files(home_files(layout, path.name), path.parent)


def home_files(layout: Layout, name: str) -> dict[Path, bytes]:
    """Return the files of a layout's home by their paths in its folder; its URDF, which has this name, last."""
    meshes: dict[str, bytes] = {}
    robot = assemble(layout, meshes)
    for model in dict.fromkeys(piece.model for piece in layout.furniture):
        meshes |= load_model(model, layout.catalog).meshes
    return {Path(MESHES, file): content for file, content in meshes.items()} | {Path(name): urdf_bytes(robot)}


def write_files(files: Mapping[Path, bytes], folder: Path) -> Path:
    """Write the files of a home, each whole or not at all, but for those that are there; return the URDF, the last."""
    for file, content in files.items():
        with suppress(ValueError):
            if read_regular(folder / file) == content:
                continue
        with replacing(folder / file) as temporary:
            temporary.write_bytes(content)
    return folder / list(files)[-1]


def assemble(layout: Layout, files: dict[str, bytes] | None = None) -> yourdfpy.Robot:
    """Return the whole home as one URDF robot: links named ``<room>/<class>_<n>``, floors at z = 0.

    Args:
        layout: of the home.
        files: gets the content of the meshes that are made for it, by their names in ``meshes``.
    """
    made: dict[str, bytes] = {} if files is None else files
    robot = yourdfpy.Robot(layout.name, links=[_link(ROOT)])
    if layout.object_looks is not None:
        name = f"{LOOKS_LINK}{layout.object_looks}"
        robot.links.append(_link(name))
        robot.joints.append(yourdfpy.Joint(f"fix {name}", "fixed", ROOT, name, np.eye(4)))
    names: Counter[str] = Counter()

    def fix(thing: str, link: yourdfpy.Link, origin: Array) -> None:
        names[thing] += 1
        link.name = f"{thing}_{names[thing]}"
        robot.links.append(link)
        robot.joints.append(yourdfpy.Joint(f"fix {link.name}", "fixed", ROOT, link.name, origin))

    for room in layout.rooms:
        for rect in room.rects:
            fix(f"{room.name}/floor", _floor(rect, room, made), _pose(*_centre(rect), 0.0))
    for wall in pieces(layout.rects, layout.gaps, layout.wall_thickness):
        fix(f"{wall.owner}/wall", _wall(wall, layout, made), _wall_pose(wall))
    for lintel in lintels(layout.rects, layout.gaps) if layout.door_height else ():
        fix(f"{lintel.owner}/wall", _lintel(lintel, layout, made), _wall_pose(lintel))
    for piece in layout.furniture:
        thing = f"{piece.room}/{load_model(piece.model, layout.catalog).thing_class}"
        fix(thing, _furniture(piece, layout.catalog), _pose(*piece.position, yaw=math.radians(piece.yaw)))
    return robot


def _link(name: str, visuals: Sequence[Any] = (), collisions: Sequence[Any] = ()) -> yourdfpy.Link:
    """Return a link of zero mass, which a simulator takes as static."""
    inertial = yourdfpy.Inertial(origin=np.eye(4), mass=0.0, inertia=np.zeros((3, 3)))
    return yourdfpy.Link(name, inertial, list(visuals), list(collisions))


def _pose(x: float, y: float, z: float, yaw: float = 0.0) -> Array:
    """Return the transform of a position (metres) and a rotation about z (radians)."""
    pose = np.eye(4)
    pose[:2, :2] = [[math.cos(yaw), -math.sin(yaw)], [math.sin(yaw), math.cos(yaw)]]
    pose[:3, 3] = x, y, z
    return pose


def _centre(rect: Rect) -> tuple[float, float]:
    return (rect[0] + rect[2]) / 2, (rect[1] + rect[3]) / 2


@lru_cache(maxsize=4096)
def _material(rgba: Sequence[float]) -> yourdfpy.Material:
    """Return a material named after its colour, so that equal names mean equal colours in the whole file."""
    channels = [round(channel * 255) for channel in rgba] + [255] * (4 - len(rgba))
    name = "rgba_" + "".join(f"{channel:02x}" for channel in channels)
    return yourdfpy.Material(name, yourdfpy.Color(np.array(channels) / 255))


def _box(size: Sequence[float], origin: Array, colour: Colour) -> yourdfpy.Visual:
    geometry = yourdfpy.Geometry(box=yourdfpy.Box(np.array(size)))
    return yourdfpy.Visual(origin=origin, geometry=geometry, material=_material(colour))


def _surface(
    size: Sequence[float], origin: Array, colour: Colour, texture: Path | None, files: dict[str, bytes]
) -> yourdfpy.Visual:
    """Return a box; with a texture, a mesh, whose files are noted."""
    visual = _box(size, origin, colour)
    if texture is not None:
        made = textured_box(texture, (float(size[0]), float(size[1]), float(size[2])))
        files |= made
        visual.geometry = yourdfpy.Geometry(mesh=yourdfpy.Mesh(f"{MESHES}/{list(made)[-1]}"))
    return visual


def _solid(size: Sequence[float], origin: Array) -> yourdfpy.Collision:
    return yourdfpy.Collision(None, origin, yourdfpy.Geometry(box=yourdfpy.Box(np.array(size))))


def _floor(rect: Rect, room: Room, files: dict[str, bytes]) -> yourdfpy.Link:
    """Return a floor in the frame of its rectangle's centre, its top at z = 0."""
    size, origin = (rect[2] - rect[0], rect[3] - rect[1], FLOOR_THICKNESS), _pose(0, 0, -FLOOR_THICKNESS / 2)
    return _link("", [_surface(size, origin, room.floor, room.floor_texture, files)], [_solid(size, origin)])


def _wall_pose(wall: Wall) -> Array:
    """Return the frame of a wall: the middle of its foot, x along the wall."""
    middle = (wall.start + wall.end) / 2
    return _pose(middle, wall.line, 0) if wall.axis == "x" else _pose(wall.line, middle, 0, math.pi / 2)


def _wall(wall: Wall, layout: Layout, files: dict[str, bytes]) -> yourdfpy.Link:
    """Return a wall: one solid, each face in the looks of its room, with skirting and trim at doorways."""
    length, thickness, height = wall.end - wall.start, layout.wall_thickness, layout.wall_height
    visuals = _faces(wall, layout, 0.0, files)
    for side, room in _sides(wall, layout):
        red, green, blue = (SKIRTING_SHADE * channel for channel in room.wall)
        middle = _pose(0, side * (thickness + SKIRTING[0]) / 2, SKIRTING[1] / 2)
        visuals.append(_box((length, *SKIRTING), middle, (red, green, blue)))
    top = layout.door_height or height
    for jamb, end in zip(wall.jambs, (-1, 1), strict=True):
        if jamb:
            x = end * ((length - JAMB[0]) / 2 + 0.001)
            visuals.append(_box((JAMB[0], thickness + 2 * JAMB[1], top + 0.001), _pose(x, 0, top / 2), TRIM))
    return _link("", visuals, [_solid((length, thickness, height), _pose(0, 0, height / 2))])


def _lintel(wall: Wall, layout: Layout, files: dict[str, bytes]) -> yourdfpy.Link:
    """Return the piece of wall above a doorway, with trim below it."""
    length, thickness, height = wall.end - wall.start, layout.wall_thickness, layout.wall_height
    bottom = layout.door_height or height
    board = (length + 2 * JAMB[0], thickness + 2 * JAMB[1], JAMB[0])
    visuals = [*_faces(wall, layout, bottom, files), _box(board, _pose(0, 0, bottom - JAMB[0] / 2), TRIM)]
    return _link("", visuals, [_solid((length, thickness, height - bottom), _pose(0, 0, (height + bottom) / 2))])


def _faces(wall: Wall, layout: Layout, bottom: float, files: dict[str, bytes]) -> list[yourdfpy.Visual]:
    """Return a wall from a height up: one box, or one for each of the two rooms beside it."""
    length, thickness, height = wall.end - wall.start, layout.wall_thickness, layout.wall_height
    middle, sides = (height + bottom) / 2, _sides(wall, layout)
    if len(sides) == 1:
        ((_, room),) = sides
        size = (length, thickness, height - bottom)
        return [_surface(size, _pose(0, 0, middle), room.wall, room.wall_texture, files)]
    half = (length, thickness / 2, height - bottom)
    return [
        _surface(half, _pose(0, side * thickness / 4, middle), room.wall, room.wall_texture, files)
        for side, room in sides
    ]


def _sides(wall: Wall, layout: Layout) -> list[tuple[int, Room]]:
    """Return the rooms beside a wall, and whether each lies on its +y side (1) or its -y side (-1)."""
    rooms = {room.name: room for room in layout.rooms}
    # The wall's frame has x along the wall: its +y side is the room above, or the room below when it runs along y.
    names = (wall.above, wall.below) if wall.axis == "x" else (wall.below, wall.above)
    return [(side, rooms[name]) for side, name in zip((1, -1), names, strict=True) if name]


def _furniture(piece: Furniture, known: Catalog) -> yourdfpy.Link:
    """Return a model's link with the colours of this piece, its meshes found beside the home."""
    link = load_model(piece.model, known).link
    recoloured = {"primary": piece.color, "secondary": piece.secondary}
    visuals = []
    for visual in link.visuals:
        material = _material(recoloured.get(visual.material.name) or tuple(visual.material.color.rgba.tolist()))
        visuals.append(yourdfpy.Visual(visual.name, visual.origin, _beside(visual.geometry), material))
    collisions = [yourdfpy.Collision(solid.name, solid.origin, _beside(solid.geometry)) for solid in link.collisions]
    return _link("", visuals, collisions)


def _beside(geometry: yourdfpy.Geometry) -> yourdfpy.Geometry:
    """Return a model's geometry with its mesh found beside the home."""
    if geometry.mesh is None:
        return geometry
    return yourdfpy.Geometry(mesh=yourdfpy.Mesh(f"{MESHES}/{basename(geometry.mesh.filename)}", geometry.mesh.scale))
