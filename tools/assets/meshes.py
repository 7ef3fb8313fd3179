"""Low-poly triangle meshes from a few primitives, and their OBJ files.

Lengths are metres, angles radians. Every solid stands on z = 0, centred on the z axis, unless it says
otherwise; move it with ``moved``, ``turned`` and ``scaled``. Triangles wind counterclockwise seen from outside.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

#: Edges flatter than this angle are shaded smooth, sharper ones as an edge.
CREASE = np.radians(44)


@dataclass(frozen=True)
class Mesh:
    """Triangles with a normal at every corner.

    Attributes:
        triangles: corners, shape (count, 3, 3).
        normals: unit normals of the corners, shape (count, 3, 3).
    """

    triangles: Array
    normals: Array

    def __len__(self) -> int:
        """The number of triangles."""
        return len(self.triangles)

    @property
    def bounds(self) -> Array:
        """Lowest and highest corner, shape (2, 3)."""
        corners = self.triangles.reshape(-1, 3)
        return np.stack([corners.min(axis=0), corners.max(axis=0)])

    def moved(self, x: float = 0.0, y: float = 0.0, z: float = 0.0) -> "Mesh":
        """Return the mesh shifted by a vector."""
        return Mesh(self.triangles + np.array([x, y, z]), self.normals)

    def turned(self, axis: str, angle: float) -> "Mesh":
        """Return the mesh rotated by ``angle`` about the x, y or z axis through the origin."""
        first, second = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
        rotation = np.eye(3)
        rotation[[first, second], [first, second]] = np.cos(angle)
        rotation[second, first], rotation[first, second] = np.sin(angle), -np.sin(angle)
        return Mesh(self.triangles @ rotation.T, self.normals @ rotation.T)

    def scaled(self, x: float = 1.0, y: float = 1.0, z: float = 1.0) -> "Mesh":
        """Return the mesh stretched about the origin; negative factors mirror it."""
        factors = np.array([x, y, z])
        mesh = Mesh(self.triangles * factors, _unit(self.normals / factors))
        return flipped(mesh, keep_normals=True) if np.prod(factors) < 0 else mesh


def join(*meshes: Mesh) -> Mesh:
    """Return one mesh with the triangles of all."""
    return Mesh(np.concatenate([m.triangles for m in meshes]), np.concatenate([m.normals for m in meshes]))


def flipped(mesh: Mesh, keep_normals: bool = False) -> Mesh:
    """Return the mesh turned inside out."""
    sign = 1.0 if keep_normals else -1.0
    return Mesh(mesh.triangles[:, ::-1], sign * mesh.normals[:, ::-1])


def shaded(triangles: Array, crease: float = CREASE) -> Mesh:
    """Give triangles their normals: averaged over neighbours, but not across edges sharper than ``crease``."""
    area = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    keep = np.linalg.norm(area, axis=1) > 1e-10
    triangles, area = triangles[keep], area[keep]
    face = np.repeat(_unit(area), 3, axis=0)
    corner = np.round(triangles.reshape(-1, 3), 6)
    near = (corner[:, None] == corner[None]).all(axis=2) & (face @ face.T > np.cos(crease))
    normals = _unit(near @ np.repeat(area, 3, axis=0))
    return Mesh(triangles, normals.reshape(-1, 3, 3))


def loft(rings: ArrayLike, caps: bool = True, crease: float = CREASE) -> Mesh:
    """Skin a stack of closed rings.

    Args:
        rings: shape (rings, points, 3); each counterclockwise seen from the side that the next one lies on.
        caps: close the first and the last ring, which must be convex.
        crease: see ``shaded``.
    """
    rings = np.asarray(rings, dtype=float)
    low, high = rings[:-1], rings[1:]
    low_next, high_next = np.roll(low, -1, axis=1), np.roll(high, -1, axis=1)
    sides = [np.stack([low, low_next, high_next], axis=2), np.stack([low, high_next, high], axis=2)]
    parts = [side.reshape(-1, 3, 3) for side in sides]
    if caps:
        parts += [_fan(rings[0][::-1]), _fan(rings[-1])]
    return shaded(np.concatenate(parts), crease)


def lathe(profile: Sequence[tuple[float, float]], segments: int = 12, crease: float = CREASE) -> Mesh:
    """Turn a profile about the z axis.

    Args:
        profile: (radius, z) points, from the bottom outwards and up, then down again inside a hollow;
            ends with a radius above 0 stay open.
        segments: corners of each circle.
        crease: see ``shaded``.
    """
    circle = ngon(1.0, segments)
    rings = [np.column_stack([radius * circle, np.full(segments, height)]) for radius, height in profile]
    return loft(rings, caps=False, crease=crease)


def cylinder(radius: float, height: float, segments: int = 12, top: float | None = None) -> Mesh:
    """Return a closed cylinder, or a cone frustum with radius ``top`` at its upper end."""
    return lathe([(0, 0), (radius, 0), (radius if top is None else top, height), (0, height)], segments)


def sphere(radius: float, segments: int = 12, rings: int = 6) -> Mesh:
    """Return a sphere that stands on z = 0."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, rings + 1)
    profile = [(radius * max(np.cos(a), 0.0), radius * (1 + np.sin(a))) for a in angles]
    profile[0], profile[-1] = (0.0, 0.0), (0.0, 2 * radius)
    return lathe(profile, segments, crease=np.radians(80))


def ellipsoid(x: float, y: float, z: float, segments: int = 10, rings: int = 5) -> Mesh:
    """Return an ellipsoid of full size (x, y, z) that stands on z = 0."""
    return sphere(0.5, segments, rings).scaled(x, y, z)


def box(x: float, y: float, z: float) -> Mesh:
    """Return a box of size (x, y, z) that stands on z = 0."""
    return extrude(rectangle(x, y), z)


def rounded_box(x: float, y: float, z: float, radius: float, steps: int = 1, bevel: float | None = None) -> Mesh:
    """Return a box with rounded upright edges and bevelled top and bottom edges.

    Args:
        x: size along x.
        y: size along y.
        z: height.
        radius: radius of the upright edges.
        steps: segments of each upright edge; 1 is a chamfer.
        bevel: width of the top and bottom bevels, ``radius`` when left out, 0 for none.
    """
    bevel = min(radius if bevel is None else bevel, 0.499 * z)
    wide = rounded_rectangle(x, y, radius, steps)
    if bevel == 0:
        return extrude(wide, z)
    small = wide * (np.array([x - 1.2 * bevel, y - 1.2 * bevel]) / np.array([x, y]))
    rings = [at_height(small, 0), at_height(wide, bevel), at_height(wide, z - bevel), at_height(small, z)]
    return loft(rings, crease=np.radians(50))


def extrude(polygon: ArrayLike, height: float, top: float = 1.0) -> Mesh:
    """Raise a polygon, which may be concave, to a prism.

    Args:
        polygon: (x, y) corners, counterclockwise.
        height: height of the prism.
        top: scale of the upper face.
    """
    outline = np.asarray(polygon, dtype=float)
    low, high = at_height(outline, 0.0), at_height(outline * top, height)
    caps = ears(outline)
    sides = loft([low, high], caps=False)
    return join(sides, shaded(low[caps[:, ::-1]]), shaded(high[caps]))


def tube(path: ArrayLike, radius: float | Sequence[float], segments: int = 6, closed: bool = False) -> Mesh:
    """Sweep a circle along a path.

    Args:
        path: (x, y, z) points.
        radius: one radius, or one for each point.
        segments: corners of the circle.
        closed: join the end to the start (a ring).
    """
    points = np.asarray(path, dtype=float)
    radii = np.broadcast_to(np.asarray(radius, dtype=float), len(points))
    if closed:
        ahead, behind = np.roll(points, -1, axis=0), np.roll(points, 1, axis=0)
        tangents = _unit(ahead - behind)
    else:
        tangents = _unit(np.gradient(points, axis=0))
    side = _unit(np.cross(tangents[0], np.eye(3)[np.argmin(np.round(np.abs(tangents[0]), 6))]))
    rings = []
    for point, tangent, r in zip(points, tangents, radii, strict=True):
        side = _unit(side - tangent * (side @ tangent))
        circle = ngon(r, segments)
        rings.append(point + circle[:, :1] * side + circle[:, 1:] * np.cross(tangent, side))
    if closed:
        rings.append(rings[0])
    return loft(rings, caps=not closed, crease=np.radians(75))


def ngon(radius: float, corners: int) -> Array:
    """Return the corners (x, y) of a regular polygon, counterclockwise from +x."""
    angles = np.arange(corners) * (2 * np.pi / corners)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def rectangle(x: float, y: float) -> Array:
    """Return the corners of a centred rectangle, counterclockwise."""
    return np.array([[-x, -y], [x, -y], [x, y], [-x, y]]) / 2


def rounded_rectangle(x: float, y: float, radius: float, steps: int = 2) -> Array:
    """Return a centred rectangle whose corners are arcs of ``steps`` segments."""
    centres = rectangle(x - 2 * radius, y - 2 * radius)
    quarter = np.linspace(0, np.pi / 2, steps + 1)
    starts = np.pi * np.array([1.0, 1.5, 2.0, 2.5])
    arcs = [
        c + radius * np.column_stack([np.cos(s + quarter), np.sin(s + quarter)])
        for c, s in zip(centres, starts, strict=True)
    ]
    return np.concatenate(arcs)


def arc(radius: float, start: float, end: float, steps: int) -> Array:
    """Return ``steps`` + 1 points (x, y) of an arc about the origin from angle ``start`` to ``end``."""
    angles = np.linspace(start, end, steps + 1)
    return radius * np.column_stack([np.cos(angles), np.sin(angles)])


def at_height(outline: ArrayLike, z: float) -> Array:
    """Lift (x, y) points to height ``z``."""
    points = np.asarray(outline, dtype=float)
    return np.column_stack([points, np.full(len(points), z)])


def write_obj(mesh: Mesh, path: Path) -> None:
    """Write a mesh as an OBJ file with normals; the same mesh gives the same bytes."""
    vertices, vertex_ids = _indexed(mesh.triangles, digits=5)
    normals, normal_ids = _indexed(mesh.normals, digits=3)
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in vertices]
    lines += [f"vn {x:.3f} {y:.3f} {z:.3f}" for x, y, z in normals]
    for corners in np.stack([vertex_ids, normal_ids], axis=1).reshape(-1, 3, 2) + 1:
        lines.append("f " + " ".join(f"{v}//{n}" for v, n in corners))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def _indexed(corners: Array, digits: int) -> tuple[Array, NDArray[np.intp]]:
    """Return the distinct rounded points of (count, 3, 3) corners and the index of each corner's point."""
    steady = np.round(np.round(corners.reshape(-1, 3), 9), digits) + 0.0  # twice: no platform's last bit decides
    points, ids = np.unique(steady, axis=0, return_inverse=True)
    return points, ids.reshape(-1)


def _unit(vectors: Array) -> Array:
    """Scale vectors to length 1."""
    units: Array = vectors / np.maximum(np.linalg.norm(vectors, axis=-1, keepdims=True), 1e-12)
    return units


def _fan(ring: Array) -> Array:
    """Close a convex counterclockwise ring of points."""
    return np.stack([np.broadcast_to(ring[0], ring[2:].shape), ring[1:-1], ring[2:]], axis=1)


def ears(outline: Array) -> NDArray[np.intp]:
    """Cut a simple counterclockwise polygon into triangles of corner indices by clipping ears."""
    left = list(range(len(outline)))
    clipped = []
    while len(left) > 3:
        ear = next(i for i in range(len(left)) if _is_ear(outline, left, i))
        clipped.append((left[ear - 1], left[ear], left[(ear + 1) % len(left)]))
        del left[ear]
    return np.array([*clipped, tuple(left)])


def _is_ear(outline: Array, left: list[int], index: int) -> bool:
    """Whether a corner is not concave and its triangle holds no other corner."""
    corners = [left[index - 1], left[index], left[(index + 1) % len(left)]]
    a, b, c = outline[corners]
    if _turn(a, b, c) < -1e-12:
        return False
    others = (outline[i] for i in left if i not in corners)
    return not any(min(_turn(a, b, p), _turn(b, c, p), _turn(c, a, p)) > 1e-12 for p in others)


def _turn(a: Array, b: Array, c: Array) -> float:
    """Twice the signed area of a triangle: positive when it turns left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
