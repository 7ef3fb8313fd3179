"""The triangles of what moves, as TinyRenderer holds them after loading a body."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pybullet
from numpy.typing import NDArray

from chmarl_pb.sensing.placing import Models

Floats = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Part:
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


def parts_of(client: int, body: int) -> list[Part]:
    """Return the parts of a loaded body, in the order in which TinyRenderer draws them.

    The visual shapes must be OBJ meshes of triangles with normals, without a texture.
    """
    parts = []
    for shape in pybullet.getVisualShapeData(body, physicsClientId=client):
        _, link, _, scale, name, position, quaternion, rgba = shape[:8]
        centre, turn = pybullet.getDynamicsInfo(body, link, physicsClientId=client)[3:5]
        # PyBullet's own functions for transforms round to single precision.
        inverse = rotation(np.array(turn)).T
        basis = inverse @ rotation(np.array(quaternion))
        vertices, normals, corners = _read_obj(Path(name.decode()))
        scaled = (vertices.astype(float) * scale).astype(np.float32)
        colour = (np.float32(255) * np.array(rgba[:3], dtype=np.float32)).astype(np.uint8)
        moved = _moved(scaled, basis, inverse @ np.subtract(position, centre))
        parts.append(Part(link, colour, moved, _settled(_moved(normals, basis, np.zeros(3))), corners))
    return parts


def _read_obj(path: Path) -> tuple[Floats, Floats, NDArray[np.int32]]:
    """Return vertices, normals and corners of a Wavefront file."""
    rows: dict[str, list[list[float]]] = {"v": [], "vn": []}
    corners = []
    for line in path.read_text(encoding="utf-8").splitlines():
        kind, *values = line.split() or [""]
        if kind in rows:
            rows[kind].append([float(value) for value in values])
        elif kind == "f":
            numbers = [value.split("/") for value in values]
            corners.append([int(number[column]) - 1 for column in (0, 2) for number in numbers])
    return (
        np.array(rows["v"], dtype=np.float32),
        np.array(rows["vn"], dtype=np.float32),
        np.array(corners, dtype=np.int32).reshape(-1, 6),
    )


def _moved(points: Floats, basis: NDArray[np.float64], origin: NDArray[np.float64]) -> Floats:
    """Return points in a frame's parent, worked out in double precision."""
    x, y, z = points.astype(float).T
    moved = [x * row[0] + y * row[1] + z * row[2] + shift for row, shift in zip(basis, origin, strict=True)]
    return np.stack(moved, axis=1).astype(np.float32)


def _settled(normals: Floats) -> Floats:
    """Return normals as TinyRenderer has them in odd pictures: it makes them unit vectors at every use, in place."""
    for _ in range(3):
        x, y, z = normals.T
        normals = normals * (np.float32(1) / np.sqrt(x * x + y * y + z * z))[:, None]
    return normals


def rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return rotation matrices (..., 3, 3) of quaternions (..., 4) x, y, z, w, with Bullet's arithmetic."""
    x, y, z, w = np.moveaxis(quaternion, -1, 0)
    scale = 2.0 / (x * x + y * y + z * z + w * w)
    xs, ys, zs = x * scale, y * scale, z * scale
    wx, wy, wz, xx, xy, xz, yy, yz, zz = w * xs, w * ys, w * zs, x * xs, x * ys, x * zs, y * ys, y * zs, z * zs
    rows = [1 - (yy + zz), xy - wz, xz + wy, xy + wz, 1 - (xx + zz), yz - wx, xz - wy, yz + wx, 1 - (xx + yy)]
    return np.stack(rows, axis=-1).reshape(*quaternion.shape[:-1], 3, 3)


def models_of(bodies: Sequence[Sequence[Part]], frames: Sequence[dict[int, int]]) -> Models:
    """Return bodies as arrays to draw from.

    Args:
        bodies: parts of each body.
        frames: for each body, PyBullet link index -> number of its frame.
    """
    parts = [(part, frames[number][part.link]) for number, body in enumerate(bodies) for part in body]
    every = [part for part, _ in parts]
    vertices, normals = _starts([part.vertices for part in every]), _starts([part.normals for part in every])
    corners = [
        part.corners + np.repeat((vertices[number], normals[number]), 3).astype(np.int32)
        for number, part in enumerate(every)
    ]
    return Models(
        _starts(bodies),
        np.array([frame for _, frame in parts], dtype=np.int32),
        _starts(corners),
        vertices,
        normals,
        np.array([part.colour for part in every], dtype=np.uint8),
        np.concatenate([part.vertices for part in every]),
        np.concatenate([part.normals for part in every]),
        np.concatenate(corners),
        np.repeat(np.arange(len(every), dtype=np.int32), [len(rows) for rows in corners]),
        np.repeat(np.arange(len(bodies), dtype=np.int32), [len(body) for body in bodies]),
    )


def _starts(rows: Sequence[Sequence | NDArray]) -> NDArray[np.int32]:
    return np.cumsum([0, *map(len, rows)], dtype=np.int32)
