"""Meshes as triangles that are sure to be whole: from STL, and written as the plain OBJ that PyBullet gets."""

import hashlib
import re
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.solids import Points

#: Triangles of a whole home; a mesh counts as often as it is used.
MOST_TRIANGLES = 100_000
#: Colours of one mesh: each is drawn as a mesh of its own.
MOST_COLOURS = 32

_FARTHEST = 1e6  # units: no coordinate of a mesh is larger, so that none overflows in single precision
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("extra", "<u2")])
_STL_VERTEX = re.compile(rb"vertex\s+(\S+)\s+(\S+)\s+(\S+)", re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles.

    Attributes:
        vertices: (n, 3).
        corners: (triangles, 3, 3) numbers of the vertex, the texture point and the normal of each corner; -1: none.
        normals: (k, 3), none of them zero; corners without one get that of their triangle.
        texture_points: (m, 2).
        texture: a picture as the content of a BMP file, or None.
        unread: what the file has that is not read, of "colours" and "up axis".
        file: where it lies in the form that PyBullet may read; None: it has to be written first.
        colours: red, green, blue in 0..1 of its materials.
        paint: (triangles,) number of each triangle's colour, -1: none; None: no triangle has one.
    """

    vertices: Points
    corners: NDArray[np.int64]
    normals: Points
    texture_points: Points
    texture: bytes | None = None
    unread: tuple[str, ...] = ()
    file: Path | None = None
    colours: tuple[tuple[float, ...], ...] = ()
    paint: NDArray[np.int64] | None = None

    @cached_property
    def used_vertices(self) -> Points:
        """The vertices (m, 3) that are corners of triangles."""
        return self.vertices[np.unique(self.corners[..., 0])]

    @cached_property
    def reach(self) -> tuple[float, ...]:
        """How far from the origin the vertices go along each axis."""
        return tuple(np.abs(self.vertices).max(axis=0).tolist())

    @cached_property
    def in_colours(self) -> tuple[tuple[tuple[float, ...] | None, "Mesh"], ...]:
        """Its triangles of each colour, and those that have none."""
        if self.paint is None:
            return ((None, self),)
        numbers = np.unique(self.paint).tolist()
        return tuple(
            (self.colours[number], replace(self._part(self.paint == number), unread=()))
            if number >= 0
            else (None, self._part(self.paint == number))
            for number in numbers
        )

    def _part(self, triangles: NDArray[np.bool_]) -> "Mesh":
        """Return some of the triangles, with the vertices and normals that they have."""
        corners = self.corners[triangles]
        vertices, first = np.unique(corners[..., 0], return_inverse=True)
        normals, third = np.unique(corners[..., 2], return_inverse=True)
        shape, bare = corners.shape[:2], int(normals[0] < 0)  # -1: a corner without a normal
        numbers = np.stack([first.reshape(shape), np.full(shape, -1), third.reshape(shape) - bare], axis=-1)
        return Mesh(
            self.vertices[vertices], numbers, self.normals[normals[bare:]], np.zeros((0, 2)), unread=self.unread
        )

    @cached_property
    def solid(self) -> dict[str, bytes]:
        """Name and content of an OBJ file of the triangles without texture; the name tells contents apart."""
        return dict([_file(self._obj(textured=False), "obj")])

    @cached_property
    def drawn(self) -> dict[str, bytes]:
        """The same with the texture: the files that the last one, an OBJ, needs, and itself."""
        if self.texture is None:
            return self.solid
        picture = _file(self.texture, "bmp")
        library = _file(f"newmtl m\nmap_Kd {picture[0]}\n".encode(), "mtl")
        head = f"mtllib {library[0]}\nusemtl m\n".encode()
        return dict([picture, library, _file(head + self._obj(textured=True), "obj")])

    def _obj(self, textured: bool) -> bytes:
        rows = [("v", self.vertices), ("vn", self.normals)] + ([("vt", self.texture_points)] if textured else [])
        lines = [f"{kind} {' '.join(map(repr, row))}" for kind, values in rows for row in values.tolist()]
        lines += [
            "f " + " ".join(_corner(vertex, point if textured else -1, normal) for vertex, point, normal in triangle)
            for triangle in self.corners.tolist()
        ]
        return ("\n".join(lines) + "\n").encode()


def _corner(vertex: int, point: int, normal: int) -> str:
    """Return a corner as OBJ writes it, from numbers that begin at 0; -1: none."""
    between = "" if point < 0 else str(point + 1)
    return f"{vertex + 1}/{between}/{normal + 1}" if normal >= 0 else f"{vertex + 1}/{between}".rstrip("/")


def _file(content: bytes, ending: str) -> tuple[str, bytes]:
    return f"{hashlib.sha256(content).hexdigest()[:32]}.{ending}", content


def checked(mesh: Mesh) -> Mesh:
    """Return a mesh whose numbers all point somewhere.

    Raises:
        ValueError: they do not, it has no triangles, or too many.
    """
    if not len(mesh.corners):
        raise ValueError("is empty: it has no triangles")
    if len(mesh.corners) > MOST_TRIANGLES:
        raise ValueError(f"has {len(mesh.corners):,} triangles; at most {MOST_TRIANGLES:,} are read, simplify it")
    names = "vertex", "texture point", "normal"
    for place, rows in enumerate((mesh.vertices, mesh.texture_points, mesh.normals)):
        numbers = mesh.corners[..., place]
        if numbers.max() >= len(rows) or numbers.min() < (0 if place == 0 else -1):
            raise ValueError(
                f"a face names {names[place]} {numbers.max() + 1:,}, but there are {len(rows):,}; export it anew"
            )
        if not (np.abs(rows) <= _FARTHEST).all():  # False for NaN, too
            raise ValueError(f"a {names[place]} is not made of finite numbers below {_FARTHEST:,.0f}; export it anew")
    return mesh


def read_stl(content: bytes) -> Mesh:
    """Return the mesh in an STL file, binary or ASCII.

    Raises:
        ValueError: it is not such a file, or damaged.
    """
    if len(content) >= 84 and len(content) == 84 + _TRIANGLE.itemsize * int.from_bytes(content[80:84], "little"):
        return _separate(np.frombuffer(content, _TRIANGLE, offset=84)["corners"].reshape(-1, 3).astype(float))
    if content[:5].lower() != b"solid":
        raise ValueError("is not STL: its length does not fit its number of triangles; export it anew")
    words = _STL_VERTEX.findall(content)
    facets = content.lower().count(b"endfacet")
    if len(words) != 3 * facets or b"endsolid" not in content.lower():
        raise ValueError(f"is damaged STL: {len(words):,} vertices in {facets:,} facets, or no end; export it anew")
    return _separate(np.array([float(word) for vertex in words for word in vertex]).reshape(-1, 3))


def _separate(corners: Points) -> Mesh:
    """Return triangles that share no vertex, from three rows each."""
    numbers = np.full((len(corners), 3), -1)
    numbers[:, 0] = np.arange(len(corners))
    return Mesh(corners, numbers.reshape(-1, 3, 3), np.zeros((0, 3)), np.zeros((0, 2)))
