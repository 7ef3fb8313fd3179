"""The triangles of a shape in the colours that they have; textures become a few plain colours."""

import io
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.mesh import Mesh
from chmarl_pb.homes.shape import Numbers, Shape
from chmarl_pb.homes.solids import Points

_COLOURS = 8  # that a texture becomes
_WHITE = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class ColouredTriangles:
    """Triangles of one colour.

    Attributes:
        colour: red, green, blue in 0..1.
        corners: (triangles, 3, 3) in metres.
        normals: (triangles, 3, 3) of length 1.
    """

    colour: Numbers
    corners: Points
    normals: Points

    def joined(self, other: "ColouredTriangles") -> "ColouredTriangles":
        """Return the triangles of both."""
        corners, normals = (
            np.concatenate([getattr(self, name), getattr(other, name)]) for name in ("corners", "normals")
        )
        return ColouredTriangles(self.colour, corners, normals)


def triangles_by_colour(shape: Shape, frame: Points) -> list[ColouredTriangles]:
    """Return the triangles of a shape, from its link's frame; none of what is transparent or without area."""
    if shape.colour is not None and shape.colour[3] == 0:
        return []
    corners, normals = _triangles(shape)
    whole = frame @ shape.origin.frame
    corners = corners @ whole[:3, :3].T + whole[:3, 3]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(faces, axis=1)
    wide = areas > 1e-12
    flat = np.repeat((faces / np.where(wide, areas, 1)[:, None])[:, None], 3, axis=1)
    turned = flat if normals is None else normals @ whole[:3, :3].T
    lengths = np.linalg.norm(turned, axis=2, keepdims=True)
    normals = np.where(lengths > 1e-9, turned / np.where(lengths > 1e-9, lengths, 1), flat)
    colours = _colours(shape)
    kinds = {tuple(row) for row in np.unique(colours[wide], axis=0).tolist()}
    chosen = [(kind, wide & (colours == kind).all(axis=1)) for kind in sorted(kinds)]
    return [ColouredTriangles(kind, corners[rows], normals[rows]) for kind, rows in chosen]


def _triangles(shape: Shape) -> tuple[Points, Points | None]:
    """Return corners and normals (triangles, 3, 3) of a shape in its own frame; None: it has no normals."""
    if shape.mesh is None:
        return _solid(shape), None
    mesh, scale = shape.mesh, np.array(shape.sizes["scale"])
    numbers = mesh.corners if np.prod(scale) > 0 else mesh.corners[:, ::-1]  # a mirror turns triangles inside out
    corners = mesh.vertices[numbers[..., 0]] * scale
    if not len(mesh.normals) or (numbers[..., 2] < 0).any():
        return corners, None
    return corners, mesh.normals[numbers[..., 2]] / scale


def _solid(shape: Shape) -> Points:
    import trimesh  # only here: it takes a while to load

    if shape.kind == "box":
        mesh = trimesh.creation.box(shape.sizes["size"])
    elif shape.kind == "cylinder":
        mesh = trimesh.creation.cylinder(shape.sizes["radius"][0], shape.sizes["length"][0], sections=24)
    else:
        mesh = trimesh.creation.icosphere(subdivisions=2, radius=shape.sizes["radius"][0])
    return np.asarray(mesh.triangles)


def _colours(shape: Shape) -> Points:
    """Return the colour (triangles, 3) of each triangle, in 0..1."""
    plain = np.array((shape.colour or (*_WHITE, 1.0))[:3])
    mesh = shape.mesh
    if mesh is None:
        return np.tile(plain, (len(_solid(shape)), 1))
    own = np.tile(_WHITE, (len(mesh.corners), 1)) if mesh.texture is None else _of_texture(mesh)
    painted: Points = np.round(own * plain, 3)
    return painted


def _of_texture(mesh: Mesh) -> Points:
    """Return the colour of the texture in the middle of each triangle, one of a few."""
    from PIL import Image  # only here: most things have no texture

    picture = np.asarray(Image.open(io.BytesIO(mesh.texture or b"")).convert("RGB"))
    numbers = mesh.corners[..., 1]
    points = mesh.texture_points if len(mesh.texture_points) else np.zeros((1, 2))
    u, v = np.moveaxis(points[np.maximum(numbers, 0)].mean(axis=1) % 1.0, 1, 0)
    height, width = picture.shape[:2]
    rows, columns = ((1 - v) * height).astype(int) % height, (u * width).astype(int) % width
    found: NDArray[np.uint8] = picture[rows, columns]
    few = Image.fromarray(found[None]).quantize(_COLOURS, Image.Quantize.MEDIANCUT).convert("RGB")
    colours: Points = np.round(np.asarray(few)[0] / 255, 3)
    return colours
