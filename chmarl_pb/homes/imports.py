"""Import a URDF or a mesh as one of a user's things: scaled, upright, standing on its origin, with something solid.

Everything is read within the limits that homes are read in, and written in the plain form of
:class:`chmarl_pb.homes.things.Thing`; a row of the catalogue file comes with it, or nothing is written at all.
"""

import json
import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.errors import AssetError
from chmarl_pb.files import Lock, check_apart, replacing
from chmarl_pb.homes.catalog_file import OwnKind, catalog_files, load_catalog, next_order, text_fault
from chmarl_pb.homes.paint import ColouredTriangles
from chmarl_pb.homes.shape import Numbers, Origin, Shape, read_mesh
from chmarl_pb.homes.simplify import simplified
from chmarl_pb.homes.solids import Points
from chmarl_pb.homes.source import Source, safe_xml
from chmarl_pb.homes.things import MASSES, MOST_TRIANGLES, Thing, painted
from chmarl_pb.homes.urdf import Link, read_whole
from chmarl_pb.reading import read_regular

#: Axis of the file that points up -> the turn that makes it z.
_UP = {
    "z": np.eye(3),
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "x": np.array([[0, 0, -1.0], [0, 1, 0], [1, 0, 0]]),
}
AXES = tuple(_UP)
_OPTIONS = "--class, --names, --held-out, --states"  # of the command, that a row comes from
_DENSITY = 150.0  # kg in a cubic metre of the box, where a file does not say what a thing weighs
_HEAVIEST_GUESS = 2.0  # kg
_LARGEST = 4.0  # metres: no furniture is larger along a side
_SMALLEST = 0.05  # metres along its longest side
_MOST_PIECES = 64  # convex pieces of furniture


@dataclass(frozen=True)
class Wish:
    """What is to become of a file.

    Attributes:
        name: the class.
        kind: of the class.
        scale: metres in a unit of the file.
        up: the axis of the file that points up, "x", "y" or "z"; None: z, unless the file says that it is another.
        mass: kilograms; None: as the file says, else guessed from its size.
        names: names for all tasks.
        held_out: names that are not used in training.
        states: symbolic states.
    """

    name: str
    kind: OwnKind = "graspable"
    scale: float = 1.0
    up: str | None = None
    mass: float | None = None
    names: tuple[str, ...] = ()
    held_out: tuple[str, ...] = ()
    states: tuple[str, ...] = ()


def add_thing(
    file: Path,
    wish: Wish,
    catalog_file: Path,
    load: Callable[[Path], Catalog] = load_catalog,
    picture: tuple[Path, Callable[[Path, Path], object]] | None = None,
) -> tuple[Catalog, Thing]:
    """Write a thing's URDF and meshes beside a catalogue file and its row into that; return both as they are now.

    One process at a time adds to a catalogue file; others wait.

    Args:
        file: URDF, OBJ, STL or DAE.
        wish: what is to become of it.
        catalog_file: TOML; it is made if there is none.
        load: reads it before and after, and says what is wrong with it.
        picture: a file, and what draws the URDF into it before the row is written.

    Raises:
        AssetError: the file cannot be used, the class is known already or cannot be called so, or the catalogue file
            is broken.
        OptionError: the picture would be written over a file that is read.
        WriteError: the files or the picture cannot be written.
    """
    _check_words(wish)
    source = Source(file, "thing")
    thing, pieces = _thing(source, wish)
    if catalog_file.is_symlink():  # what its rows name lies beside the file itself
        catalog_file = Path(os.path.realpath(catalog_file))
    with Lock(catalog_file, wait=True):
        if picture is not None:
            check_apart(picture[0], [*source.files, *catalog_files(catalog_file)])
        return _add(thing, pieces, wish, catalog_file, load, picture), thing


def _check_words(wish: Wish) -> None:
    """Refuse what a row cannot hold, before anything is called so."""
    words = {"class": wish.name, "names": [*wish.names], "held_out": [*wish.held_out], "states": [*wish.states]}
    for key, value in words.items():
        if fault := text_fault(key, value):
            raise AssetError(f"--{key.replace('_', '-')}{fault.removeprefix(key)}")


def _add(
    thing: Thing,
    pieces: list[Points],
    wish: Wish,
    catalog_file: Path,
    load: Callable[[Path], Catalog],
    picture: tuple[Path, Callable[[Path, Path], object]] | None,
) -> Catalog:
    """Write all files of a thing, the row of the catalogue file last, or none; return the catalogue."""
    known, order = _text(catalog_file, load), next_order(catalog_file)
    files = thing.files(wish.name) if wish.kind == "graspable" else thing.files(wish.name, pieces)
    folder, new = catalog_file.parent, [name for name in files if not (catalog_file.parent / name).exists()]
    if f"{wish.name}.urdf" not in new:
        raise AssetError(f"{folder / wish.name}.urdf is there already; remove it, or give the class another name")
    try:
        for name in new:
            with replacing(folder / name) as temporary:
                temporary.write_bytes(files[name])
        with replacing(catalog_file) as temporary:
            temporary.write_text(f"{known}{_row(wish, order)}", encoding="utf-8")
            catalog = load(temporary)
            if picture is not None:
                out, draw = picture
                draw(folder / f"{wish.name}.urdf", out)
    except BaseException as error:
        for name in new:
            with suppress(OSError):
                (folder / name).unlink()
        if isinstance(error, AssetError):
            row = rf"^{re.escape(str(temporary))}: \[\[{wish.kind}\]\]( \d+)? \('{wish.name}'\): "
            message = re.sub(row, f"{catalog_file}: the row to add ({_OPTIONS}): ", str(error))
            raise AssetError(message.replace(str(temporary), str(catalog_file))) from error
        raise
    return catalog


def _text(catalog_file: Path, load: Callable[[Path], Catalog]) -> str:
    """Return what a catalogue file says now, nothing if there is none."""
    if not catalog_file.exists():
        return "# Own things; see docs/objects.md. Play with them by catalog=, --catalog or CHMARL_CATALOG.\n"
    load(catalog_file)  # says what is wrong before anything is added
    return read_regular(catalog_file).decode().rstrip() + "\n"


def _row(wish: Wish, order: int | None) -> str:
    """Return a row as TOML, whose strings and lists of strings, here of letters a to z and the like, are JSON's."""
    file = f"{wish.name}.urdf"
    model = {"urdf": file} if wish.kind == "graspable" else {"models": [file]}
    values = {
        "class": wish.name,
        "order": order,
        **model,
        "names": wish.names,
        "held_out": wish.held_out,
        "states": wish.states,
    }
    lines = [f"{key} = {json.dumps(value)}" for key, value in values.items() if value]
    return "\n".join(["", f"[[{wish.kind}]]", *lines, ""])


def read_file(file: Path, wish: Wish) -> tuple[Thing, list[Points]]:
    """Return a file as the thing that is wished for, and the corners (n, 3) of its convex pieces.

    Raises:
        AssetError: it cannot be used.
    """
    return _thing(Source(file, "thing"), wish)


def _thing(source: Source, wish: Wish) -> tuple[Thing, list[Points]]:
    """Return the same of a source; it knows then which files have been read."""
    file = source.urdf
    try:
        if not np.isfinite(wish.scale) or not 1e-6 <= wish.scale <= 1e6:
            raise ValueError(f"a scale of {wish.scale} is not from 0.000001 to 1,000,000")
        links, mass = _read(source)
        meshes = [shape.mesh for link in links for shape in link.shapes if shape.mesh is not None]
        if wish.up is None and any("up axis" in mesh.unread for mesh in meshes):
            raise ValueError(
                "says that another axis than z is up, which is not read; say which one is: --up y, or --up z if it is z"
            )
        turn = _UP[wish.up or "z"] * wish.scale
        parts = [_turned(part, turn) for link in links for part in painted(link)]
        pieces = [shape.points(link.frame) @ turn.T for link in links for shape in (link.collisions or link.visuals)]
        parts = list(simplified(parts, MOST_TRIANGLES if wish.kind == "graspable" else 4 * MOST_TRIANGLES))
        thing, foot = _standing(parts, wish.mass if wish.mass is not None else mass)
        if wish.kind == "graspable":
            thing.check()
        else:
            _check_furniture(thing, pieces)
        return thing, [piece - foot for piece in pieces]
    except ValueError as error:
        label = "" if str(error).startswith(str(file)) else f"{file}: "
        raise AssetError(f"{label}{error}") from error


def _read(source: Source) -> tuple[list[Link], float | None]:
    """Return the links of a URDF that have geometry, or one with a mesh, and the mass if the file says it."""
    file = source.urdf
    if file.suffix.lower() != ".urdf":
        shape = Shape("mesh", {"scale": (1.0, 1.0, 1.0)}, Origin(), None, read_mesh(file.name, source))
        return [Link(file.stem, np.eye(4), Origin(), shape.in_colours, (shape,), ())], None
    links = [link for link in read_whole(source) if link.shapes]
    if not links:
        raise ValueError("has no geometry; give a link a <visual>")
    masses = [
        float(element.get("value", "0")) for element in safe_xml(source.read_urdf()).iterfind("link/inertial/mass")
    ]
    return links, sum(masses) or None


def _turned(part: ColouredTriangles, turn: Points) -> ColouredTriangles:
    normals = part.normals @ turn.T
    return replace(
        part, corners=part.corners @ turn.T, normals=normals / np.linalg.norm(normals, axis=2, keepdims=True)
    )


def _standing(parts: Sequence[ColouredTriangles], mass: float | None) -> tuple[Thing, Points]:
    """Return a thing that stands on its origin, and the point that has become it."""
    if not parts:
        raise ValueError("has no triangles to be seen; give it a visible mesh")
    corners = np.concatenate([part.corners.reshape(-1, 3) for part in parts])
    low, high = corners.min(axis=0), corners.max(axis=0)
    foot, size = np.array([*(low + high)[:2] / 2, low[2]]), high - low
    if mass is None:
        mass = float(np.clip(_DENSITY * np.prod(size), MASSES[0], _HEAVIEST_GUESS))
    merged: dict[Numbers, ColouredTriangles] = {}
    for part in (replace(part, corners=part.corners - foot) for part in parts):
        merged[part.colour] = merged[part.colour].joined(part) if part.colour in merged else part
    return Thing(tuple(merged.values()), tuple(size.tolist()), False, mass), foot


def _check_furniture(thing: Thing, pieces: Sequence[Points]) -> None:
    sides = " x ".join(f"{side:.3g}" for side in thing.size)
    if max(thing.size) > _LARGEST:
        raise ValueError(f"measures {sides} m; furniture has at most {_LARGEST:g} m along a side: scale it down")
    if max(thing.size) < _SMALLEST:
        raise ValueError(f"measures {sides} m; furniture has at least {_SMALLEST:g} m along a side: scale it up")
    if len(pieces) > _MOST_PIECES:
        raise ValueError(f"has {len(pieces)} collisions; furniture has at most {_MOST_PIECES}: join some")
    count = sum(len(part.corners) for part in thing.parts)
    if count > 4 * MOST_TRIANGLES:
        raise ValueError(f"has {count:,} triangles; furniture has at most {4 * MOST_TRIANGLES:,}: simplify it")
