"""Wavefront OBJ files."""

import os
import re
from dataclasses import replace
from functools import lru_cache
from itertools import chain, pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.materials import read_materials
from chmarl_pb.homes.mesh import MOST_COLOURS, MOST_TRIANGLES, Mesh, checked
from chmarl_pb.homes.source import Source

_LEAST_NUMBERS = {b"v": 3, b"vt": 2, b"vn": 3}
#: Statements of the format that do not change what triangles there are.
_OTHERS = {
    *(b"g", b"o", b"s", b"p", b"l", b"mg", b"vp", b"usemap", b"maplib", b"lod", b"bevel", b"c_interp", b"d_interp"),
    *(b"shadow_obj", b"trace_obj", b"ctech", b"stech", b"cstype", b"deg", b"bmat", b"step", b"curv", b"curv2"),
    *(b"surf", b"parm", b"trim", b"hole", b"scrv", b"sp", b"end", b"con"),
}
#: The lines of the plainest OBJ, which PyBullet may read as it is: triangles that have normals, and nothing else.
_NUMBER, _CORNER = r"(-?\d{1,7}(?:\.\d{0,20})?)", r"([1-9]\d{0,6})//([1-9]\d{0,6})"
_PLAIN_ROW = re.compile(rf"^(vn?) {_NUMBER} {_NUMBER} {_NUMBER}$".encode(), re.MULTILINE)
_PLAIN_FACE = re.compile(rf"^f {_CORNER} {_CORNER} {_CORNER}$".encode(), re.MULTILINE)
_LONGEST_PROBLEM = 200  # characters
_SMALL = 2**16  # bytes of a file whose mesh is remembered


class _Obj:
    """What has been read of an OBJ file."""

    def __init__(self) -> None:
        self.rows: dict[bytes, list[list[float]]] = {b"v": [], b"vt": [], b"vn": []}
        self.corners: list[list[list[int]]] = []
        self.libraries: list[str] = []
        self.materials: list[str] = []
        self.used: list[int] = []  # for each triangle, how many materials had been named before it

    def take(self, line: bytes) -> None:
        """Take one line.

        Raises:
            ValueError: it is not OBJ.
        """
        keyword, *words = line.split()
        if keyword in _LEAST_NUMBERS:
            self._take_numbers(keyword, line.partition(b"#")[0].split()[1:])
        elif keyword == b"f":
            self._take_face(line.partition(b"#")[0].split()[1:])
        elif keyword == b"mtllib":
            self.libraries.append(os.fsdecode(line.split(None, 1)[1].strip()) if words else "")
        elif keyword == b"usemtl":
            self.materials.append(os.fsdecode(words[0]) if words else "")
        elif keyword not in _OTHERS:
            raise ValueError(f"{os.fsdecode(keyword[:20])!r} is no word of OBJ")

    def _take_numbers(self, keyword: bytes, words: list[bytes]) -> None:
        count = _LEAST_NUMBERS[keyword]
        if not count <= len(words) <= 7:  # a weight or a colour may follow
            raise ValueError(f"{len(words)} numbers, where there should be {count}")
        if len(self.rows[keyword]) >= 3 * MOST_TRIANGLES:
            raise ValueError(f"more than {3 * MOST_TRIANGLES:,} of them; simplify the mesh")
        self.rows[keyword].append([float(word) for word in words[:count]])

    def _take_face(self, words: list[bytes]) -> None:
        """Add a face as a fan of triangles."""
        if len(words) < 3 or len(self.corners) + len(words) - 2 > MOST_TRIANGLES:
            raise ValueError(f"a face has at least 3 corners, and a mesh at most {MOST_TRIANGLES:,} triangles")
        first, *others = [self._corner(word) for word in words]
        self.corners += [[first, one, two] for one, two in pairwise(others)]
        self.used += [len(self.materials)] * (len(others) - 1)

    def _corner(self, word: bytes) -> list[int]:
        """Return the numbers of ``vertex/texture point/normal``, from 0; -1 where there is none."""
        parts = word.split(b"/")
        if len(parts) > 3 or not parts[0]:
            raise ValueError(f"{os.fsdecode(word[:20])!r} is no corner")
        numbers = [-1, -1, -1]
        for place, (part, rows) in enumerate(zip(parts, self.rows.values(), strict=False)):
            if part:
                number = int(part)
                numbers[place] = number - 1 if number > 0 else len(rows) + number
                if number == 0 or numbers[place] < 0 or number > 3 * MOST_TRIANGLES:
                    raise ValueError(f"{os.fsdecode(word[:20])!r} names nothing; numbers begin at 1")
        return numbers


def read_obj(content: bytes, path: Path, source: Source) -> Mesh:
    """Return the mesh in an OBJ file.

    Args:
        content: of the file.
        path: where it is; the names in it are seen from there.
        source: the files of the home.

    Raises:
        ValueError: it is not OBJ, damaged, or names a file that cannot be used.
    """
    plain = (_read_small if len(content) <= _SMALL else _read_plain)(content, path)
    if plain is not None:
        return plain
    obj = _Obj()
    text = content.removeprefix(b"\xef\xbb\xbf").replace(b"\\\r\n", b" ").replace(b"\\\n", b" ")
    for number, line in enumerate(source.lines_of(text), start=1):
        if line.strip() and not line.lstrip().startswith(b"#"):
            try:
                obj.take(line)
            except ValueError as error:
                raise ValueError(f"line {number:,}: {str(error)[:_LONGEST_PROBLEM]}; export it anew") from error
    corners = np.array(obj.corners, dtype=np.int64).reshape(-1, 3, 3)
    vertices, texture_points, normals = (
        np.array(rows).reshape(-1, _LEAST_NUMBERS[kind]) for kind, rows in obj.rows.items()
    )
    if not normals.any(axis=1).all():  # PyBullet makes its own where there are none
        normals, corners = normals[:0], _without_normals(corners)
    materials = read_materials(obj.libraries, path, source)
    texture = materials.texture(obj.materials, source)
    if texture is not None:
        return checked(Mesh(vertices, corners, normals, texture_points, texture))
    return _painted(checked(Mesh(vertices, corners, normals, texture_points)), obj, materials.colours)


def _painted(mesh: Mesh, obj: _Obj, colours: dict[str, tuple[float, ...]]) -> Mesh:
    """Return a mesh in the colours of its materials; they count as unread where one has none, or they are too many."""
    names = ("", *obj.materials)
    used = {names[number] for number in obj.used} - {""}
    drawn = sorted(used & colours.keys())
    if len(drawn) > MOST_COLOURS or not drawn:
        return replace(mesh, unread=("colours",) if used and obj.libraries else ())
    places = {name: number for number, name in enumerate(drawn)}
    paint = np.array([places.get(names[number], -1) for number in obj.used], dtype=np.int64)
    unread = ("colours",) if used - colours.keys() else ()
    return replace(mesh, colours=tuple(colours[name] for name in drawn), paint=paint, unread=unread)


def _read_plain(content: bytes, path: Path) -> Mesh | None:
    """Return the mesh in the plainest kind of OBJ file, many times as fast; None if it is of another kind."""
    if content.count(b"\n") > 5 * MOST_TRIANGLES:
        return None
    rows, faces = _PLAIN_ROW.findall(content), _PLAIN_FACE.findall(content)
    if len(rows) + len(faces) != content.count(b"\n") or not content.endswith(b"\n"):
        return None
    vertices, normals = (
        np.array([[float(x), float(y), float(z)] for found, x, y, z in rows if found == kind]).reshape(-1, 3)
        for kind in (b"v", b"vn")
    )
    corners = np.full((len(faces), 3, 3), -1)
    corners[..., ::2] = np.fromiter(map(int, chain.from_iterable(faces)), np.int64).reshape(-1, 3, 2) - 1
    if not normals.any(axis=1).all():
        return None
    return checked(Mesh(vertices, corners, normals, np.zeros((0, 2)), file=path))


_read_small = lru_cache(maxsize=512)(_read_plain)
"""The same, remembered: homes share the meshes of their furniture."""


def _without_normals(corners: NDArray[np.int64]) -> NDArray[np.int64]:
    return np.where(np.arange(3) == 2, -1, corners)
