"""The triangles of a body, as TinyRenderer holds them after loading it."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import islice, pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.errors import AssetError
from chmarl_pb.rendering.placing import Models
from chmarl_pb.world import Pose, Vector
from chmarl_pb.world.bullet import pybullet

Floats = NDArray[np.float32]
Mesh = tuple[Floats, Floats, NDArray[np.int32]]
"""Vertices, normals and corners."""

# TinyRenderer's box: corners of each side, its normal, and its two triangles.
_BOX_CORNERS = (
    (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1),
    (-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1),
    (-1, -1, -1), (-1, 1, -1), (-1, 1, 1), (-1, -1, 1),
    (1, -1, -1), (1, 1, -1), (1, 1, 1), (1, -1, 1),
    (-1, -1, -1), (-1, -1, 1), (1, -1, 1), (1, -1, -1),
    (-1, 1, -1), (-1, 1, 1), (1, 1, 1), (1, 1, -1),
)  # fmt: skip
_BOX_NORMALS = ((0, 0, 1), (0, 0, -1), (-1, 0, 0), (1, 0, 0), (0, -1, 0), (0, 1, 0))
_FORTH, _BACK = (0, 1, 2, 0, 2, 3), (2, 1, 0, 3, 2, 0)
_BOX_TRIANGLES = (_FORTH, _BACK, _BACK, _FORTH, _BACK, _FORTH)


@dataclass(frozen=True, eq=False)
class LinkMesh:
    """A mesh of one colour, fixed to a link.

    Attributes:
        link: PyBullet link index, -1 for the base.
        colour: (3,) bytes.
        vertices: (n, 3) in the link's inertial frame, metres.
        normals: (m, 3) in the link's inertial frame.
        corners: (triangles, 6) numbers of three vertices and three normals.
    """

    link: int
    colour: NDArray[np.uint8]
    vertices: Floats
    normals: Floats
    corners: NDArray[np.int32]


def link_meshes_of(client: int, bodies: Sequence[int]) -> list[list[LinkMesh]]:
    """Return the parts of each of some loaded bodies, in the order in which TinyRenderer draws them.

    Raises:
        AssetError: a visual shape is neither a box nor an OBJ mesh of triangles with normals and without materials.
        FileNotFoundError: a mesh is no longer where it was when PyBullet read it.
    """
    read: dict[bytes, Mesh] = {}  # once for all shapes of a file
    own = [list(_shapes(client, body, read)) for body in bodies]
    parts = iter(_parts([shape for shapes in own for shape in shapes]))
    return [list(islice(parts, len(shapes))) for shapes in own]


def _parts(shapes: Sequence["_Shape"]) -> list[LinkMesh]:
    """Return shapes in the inertial frames of their links, all worked out at once."""
    if not shapes:
        return []
    counts = np.array([[len(rows) for rows in shape.mesh] for shape in shapes])
    vertices, normals, _ = (np.concatenate(rows) for rows in zip(*(shape.mesh for shape in shapes), strict=True))
    bases, shifts, scales = (np.array(rows) for rows in zip(*(shape[2:5] for shape in shapes), strict=True))
    of_vertex, of_normal = (np.repeat(np.arange(len(shapes)), number) for number in counts.T[:2])
    points = (vertices.astype(float) * scales[of_vertex]).astype(np.float32)
    moved = _moved(points, bases[of_vertex], shifts[of_vertex])
    turned = _settled(_moved(normals, bases[of_normal], np.zeros((1, 3))))
    own, directions = (pairwise([0, *np.cumsum(number).tolist()]) for number in counts.T[:2])
    return [
        LinkMesh(shape.link, shape.colour, moved[slice(*rows)], turned[slice(*others)], shape.mesh[2])
        for shape, rows, others in zip(shapes, own, directions, strict=True)
    ]


class _Shape(NamedTuple):
    """A visual shape: its mesh, and how that comes into the link's inertial frame: scaled, turned and shifted."""

    link: int
    colour: NDArray[np.uint8]
    basis: NDArray[np.float64]
    shift: NDArray[np.float64]
    scale: Sequence[float]
    mesh: Mesh


def _shapes(client: int, body: int, read: dict[bytes, Mesh]) -> Iterator[_Shape]:
    """Yield what there is to see of a body; what is read is added to the meshes by the names of their files."""
    inertial: dict[int, tuple[Vector, Vector]] = {}
    flags = pybullet.VISUAL_SHAPE_DATA_TEXTURE_UNIQUE_IDS
    for shape in pybullet.getVisualShapeData(body, flags, physicsClientId=client):
        _, link, kind, size, name, position, quaternion, rgba, texture = shape[:9]
        if texture >= 0:
            raise AssetError(f"{name.decode() or 'a box'}: textures are not known to our own rasteriser")
        if kind != pybullet.GEOM_BOX and name not in read:
            read[name] = _read(_obj_path(kind, name))
        mesh = _box() if kind == pybullet.GEOM_BOX else read[name]
        if rgba[3] == 0 or not len(mesh[2]):
            continue  # nothing to see
        if link not in inertial:
            inertial[link] = pybullet.getDynamicsInfo(body, link, physicsClientId=client)[3:5]
        scale = [0.5 * side for side in size] if kind == pybullet.GEOM_BOX else size
        yield _Shape(link, _colour(rgba[:3]), *_seen_from(inertial[link], (position, quaternion)), scale, mesh)


@lru_cache(maxsize=4096)
def _seen_from(frame: Pose, pose: Pose) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return basis and shift of a pose as seen from a frame; homes share those of their furniture."""
    inverse = _turn(frame[1]).T  # PyBullet's own functions for transforms round to single precision
    return inverse @ _turn(pose[1]), inverse @ np.subtract(pose[0], frame[0])


@lru_cache(maxsize=1024)
def _colour(rgb: tuple[float, ...]) -> NDArray[np.uint8]:
    """Return a colour as TinyRenderer rounds it; most shapes of a home have one of a few."""
    return (np.float32(255) * np.array(rgb, dtype=np.float32)).astype(np.uint8)


def _obj_path(kind: int, name: bytes) -> str:
    path = name.decode()
    if kind != pybullet.GEOM_MESH or os.path.splitext(path)[1].lower() != ".obj":
        raise AssetError(f"{path or 'a visual shape'}: only boxes and OBJ meshes can be drawn by our own rasteriser")
    return path


@cache
def _box() -> Mesh:
    """Return TinyRenderer's box of side 2 m: four corners a side, two triangles each."""
    triangles = np.array([[4 * side + corner for corner in row] for side, row in enumerate(_BOX_TRIANGLES)])
    numbers = triangles.reshape(-1, 3)
    normals = np.repeat(_BOX_NORMALS, 4, axis=0).astype(np.float32)
    return np.array(_BOX_CORNERS, np.float32), normals, np.hstack([numbers, numbers]).astype(np.int32)


def _read(path: str) -> Mesh:
    """Return what is in a Wavefront file; homes share many, so an unchanged one is read once."""
    status = os.stat(path)
    return _read_once(path, status.st_mtime_ns, status.st_size)


@lru_cache(maxsize=1024)
def _read_once(path: str, _modified: int, _size: int) -> Mesh:
    return _read_obj(Path(path))


def _read_obj(path: Path) -> Mesh:
    """Return vertices, normals and corners of a Wavefront file.

    Raises:
        AssetError: it has materials, polygons of more than three corners, corners without normals, or numbers that
            point nowhere.
    """
    rows: dict[str, list[list[float]]] = {"v": [], "vn": []}
    corners = []
    try:
        for line in path.read_text(encoding="utf-8").splitlines():
            kind, *values = line.split() or [""]
            if kind in rows:
                rows[kind].append([float(value) for value in values[:3]])
            elif kind == "f":
                (a, _, u), (b, _, v), (c, _, w) = (value.split("/") for value in values)
                corners.append([int(number) - 1 for number in (a, b, c, u, v, w)])
            elif kind == "mtllib":
                raise AssetError(f"{path}: materials are not known to our own rasteriser")
        vertices, normals = (np.array(rows[kind], dtype=np.float32).reshape(-1, 3) for kind in ("v", "vn"))
    except ValueError as error:
        raise AssetError(f"{path}: not a mesh of triangles with normals ({error})") from error
    numbers = np.array(corners, dtype=np.int32).reshape(-1, 6)
    # The compiled code does not look whether a number is in range.
    if (numbers < 0).any() or (numbers >= np.repeat((len(vertices), len(normals)), 3)).any():
        raise AssetError(f"{path}: a face names a corner or a normal that the file does not have")
    if not (normals != 0).any(axis=1).all():
        raise AssetError(f"{path}: a normal has no direction")
    return vertices, normals, numbers


def _moved(points: Floats, bases: NDArray[np.float64], origins: NDArray[np.float64]) -> Floats:
    """Return points (n, 3) in their frames' parents, each by a basis (3, 3) and an origin, in double precision."""
    x, y, z = points.astype(float).T
    moved = np.empty(points.shape, dtype=np.float32)
    for axis in range(3):
        row = bases[:, axis]
        moved[:, axis] = x * row[:, 0] + y * row[:, 1] + z * row[:, 2] + origins[:, axis]
    return moved


def _settled(normals: Floats) -> Floats:
    """Return normals as TinyRenderer has them in odd pictures: it makes them unit vectors at every use, in place."""
    for _ in range(3):
        x, y, z = normals.T
        normals = normals * (np.float32(1) / np.sqrt(x * x + y * y + z * z))[:, None]
    return normals


@lru_cache(maxsize=1024)
def _turn(quaternion: tuple[float, ...]) -> NDArray[np.float64]:
    """Return the rotation matrix of one quaternion; most shapes of a home have one of a few."""
    return rotation(np.array(quaternion))


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation matrices (..., 3, 3) of quaternions (..., 4) x, y, z, w, with Bullet's arithmetic."""
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * scale, y * scale, z * scale
    wx, wy, wz, xx, xy, xz, yy, yz, zz = w * xs, w * ys, w * zs, x * xs, x * ys, x * zs, y * ys, y * zs, z * zs
    rows = [1 - (yy + zz), xy - wz, xz + wy, xy + wz, 1 - (xx + zz), yz - wx, xz - wy, yz + wx, 1 - (xx + yy)]
    return np.stack(rows, axis=-1).reshape(*quaternion.shape[:-1], 3, 3)


def models_of(bodies: Sequence[Sequence[LinkMesh]], frames: Sequence[dict[int, int]]) -> Models:
    """Return bodies as arrays to draw from.

    Args:
        bodies: parts of each body.
        frames: for each body, PyBullet link index -> number of its frame.
    """
    parts = [(part, frames[number][part.link]) for number, body in enumerate(bodies) for part in body]
    every = [part for part, _ in parts]
    vertices, normals = _starts([part.vertices for part in every]), _starts([part.normals for part in every])
    corners = [part.corners for part in every]
    owners = np.repeat(np.arange(len(every), dtype=np.int32), [len(rows) for rows in corners])
    firsts = np.column_stack([vertices, vertices, vertices, normals, normals, normals])[owners]
    return Models(
        _starts(bodies),
        np.array([frame for _, frame in parts], dtype=np.int32),
        _starts(corners),
        vertices,
        np.array([part.colour for part in every], dtype=np.uint8),
        np.concatenate([part.vertices for part in every]),
        np.concatenate([part.normals for part in every]),
        np.concatenate(corners) + firsts,
        owners,
        np.repeat(np.arange(len(bodies), dtype=np.int32), [len(body) for body in bodies]),
    )


def _starts(rows: Sequence[Sequence[Any] | NDArray[Any]]) -> NDArray[np.int32]:
    return np.cumsum([0, *map(len, rows)], dtype=np.int32)
