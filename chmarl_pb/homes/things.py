"""Things that a user brings, a URDF or a mesh: coloured triangles in the thing's own frame, and what is solid of it.

An object's frame has its origin under the middle of its collision box, z up. Whatever shapes it is made of, PyBullet
and our own rasteriser get it in one plain form: :meth:`Thing.files`.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from chmarl_pb.errors import AssetError
from chmarl_pb.homes.paint import ColouredTriangles, triangles_by_colour
from chmarl_pb.homes.plain import plain_mesh
from chmarl_pb.homes.shape import Numbers, Shape, numbers_of
from chmarl_pb.homes.solids import Points, bounds
from chmarl_pb.homes.source import Source, safe_xml
from chmarl_pb.homes.urdf import Link, read_whole

#: Triangles of one object: all are gone through in every picture.
MOST_TRIANGLES = 5000
#: Metres along each side of an object that the gripper takes.
SIDES = (0.01, 0.35)
#: Kilograms that the arm lifts.
MASSES = (0.001, 3.0)

_MOST_CORNERS = 200  # of a convex piece of furniture
_FRICTION = '<contact><lateral_friction value="0.8"/><spinning_friction value="0.01"/></contact>'


@dataclass(frozen=True, eq=False)
class Thing:
    """One object.

    Attributes:
        parts: what a camera sees.
        size: extents x, y, z in metres of the box that it is for physics, or of the box around its cylinder.
        round: whether it is an upright cylinder for physics.
        mass: kilograms; its centre is the middle of the box.
    """

    parts: tuple[ColouredTriangles, ...]
    size: Numbers
    round: bool
    mass: float

    def check(self) -> None:
        """Check that the gripper can take it and that it is quick to draw.

        Raises:
            ValueError: it cannot, or is not.
        """
        sides, (least, most) = " x ".join(f"{side:.3g}" for side in self.size), SIDES
        if max(self.size) > most:
            raise ValueError(f"measures {sides} m, too big to grasp; at most {most} m along each side: scale it down")
        if min(self.size) < least:
            raise ValueError(f"measures {sides} m, too small to grasp; at least {least} m along each side: scale it up")
        if not MASSES[0] <= self.mass <= MASSES[1]:
            raise ValueError(f"weighs {self.mass:g} kg; the arm lifts {MASSES[0]} to {MASSES[1]:g} kg: change <mass>")
        count = sum(len(part.corners) for part in self.parts)
        if not 0 < count <= MOST_TRIANGLES:
            raise ValueError(
                f"has {count:,} triangles to be seen; give it 1 to {MOST_TRIANGLES:,}, as by Blender's 'Decimate'"
            )

    def files(self, name: str, pieces: Sequence[Points] | None = None) -> dict[str, bytes]:
        """Return name and content of its files, the URDF the first; meshes are named after their content.

        Args:
            name: of the URDF.
            pieces: of furniture, the corners (n, 3) of its convex pieces, which are solid in place of the box.

        Raises:
            ValueError: a piece is flat.
        """
        meshes = [plain_mesh(part.corners, part.normals) for part in self.parts]
        hulls = [] if pieces is None else _hulls(pieces)
        solid = self._box() if pieces is None else [_mesh_of(mesh) for mesh, _ in hulls]
        collisions = [f"<collision>{shape}</collision>" for shape in solid]
        visuals = [
            f"<visual>{_mesh_of(mesh)}\n{_material(part)}</visual>"
            for part, (mesh, _) in zip(self.parts, meshes, strict=True)
        ]
        lines = [
            '<?xml version="1.0"?>', f'<robot name="{name}">', '<link name="base">', _FRICTION, self._inertial(),
            *collisions, *visuals, "</link>", "</robot>", "",
        ]  # fmt: skip
        return {f"{name}.urdf": "\n".join(lines).encode(), **dict([*meshes, *hulls])}

    def _box(self) -> list[str]:
        x, y, z = self.size
        box, cylinder = f'<box size="{x:.5f} {y:.5f} {z:.5f}"/>', f'<cylinder radius="{x / 2:.5f}" length="{z:.5f}"/>'
        return [f"{self._middle()}<geometry>{cylinder if self.round else box}</geometry>"]

    def _inertial(self) -> str:
        x, y, z = self.size
        ixx, iyy, izz = (self.mass / 12 * (a * a + b * b) for a, b in ((y, z), (x, z), (x, y)))
        return (
            f'<inertial>{self._middle()}<mass value="{self.mass:.6g}"/>\n'
            f'<inertia ixx="{ixx:.4g}" ixy="0" ixz="0" iyy="{iyy:.4g}" iyz="0" izz="{izz:.4g}"/></inertial>'
        )

    def _middle(self) -> str:
        return f'<origin xyz="0 0 {self.size[2] / 2:.5f}"/>'


def _mesh_of(file: str) -> str:
    return f'<geometry><mesh filename="{file}"/></geometry>'


def _material(part: ColouredTriangles) -> str:
    rgba = " ".join(f"{channel:.3g}" for channel in (*part.colour, 1.0))
    return f'<material name="{rgba}"><color rgba="{rgba}"/></material>'


def _hulls(pieces: Sequence[Points]) -> list[tuple[str, bytes]]:
    """Return name and content of the meshes of convex hulls; flat pieces are left out.

    Raises:
        ValueError: all are flat.
    """
    found = [hull for piece in pieces if (hull := _hull(piece)) is not None]
    if not found:
        raise ValueError("is flat; what is solid needs a thickness")
    return [plain_mesh(corners, normals) for corners, normals in found]


def _hull(points: Points) -> tuple[Points, Points] | None:
    """Return corners and normals (triangles, 3, 3) of a convex hull, of the box around it where it has many corners."""
    try:
        hull = ConvexHull(points)
        if len(hull.vertices) > _MOST_CORNERS:
            points = np.array(list(product(*zip(points.min(axis=0), points.max(axis=0), strict=True))))
            hull = ConvexHull(points)
    except QhullError:
        return None
    corners, outward = points[hull.simplices], hull.equations[:, :3]
    faces = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inside_out = np.einsum("ij,ij->i", faces, outward) < 0
    corners[inside_out] = corners[inside_out][:, ::-1]
    return corners, np.repeat(outward[:, None], 3, axis=1)


def read_thing(source: Source) -> Thing:
    """Return the object in a URDF.

    A single level box or upright cylinder is what physics gets; any other collision counts as the level box around all.

    Raises:
        AssetError: the URDF cannot be read, or is no object that can be grasped.
    """
    try:
        links = [link for link in read_whole(source) if link.visuals or link.collisions]
        if len(links) != 1:
            raise ValueError(f"{len(links)} links have geometry; an object is one, join them in one <link>")
        thing = thing_of(links[0], _mass(source))
        thing.check()
        return thing
    except ValueError as error:
        label = "" if str(error).startswith(str(source.urdf)) else f"{source.urdf}: "
        raise AssetError(f"{label}{error}") from error


def _mass(source: Source) -> float:
    element = safe_xml(source.read_urdf()).find("link/inertial/mass")
    (mass,) = numbers_of(element, "value", (0.0,))
    if element is None:
        raise ValueError("has no mass; write <inertial><mass value=...> in kilograms into its link")
    return mass


def thing_of(link: Link, mass: float) -> Thing:
    """Return the object that a link is, its frame moved under the middle of its collisions.

    Raises:
        ValueError: it has no collisions.
    """
    if not link.collisions:
        raise ValueError("has no <collision>; add one, best a box around it")
    low, high = bounds(link.solids)
    size = tuple(float(side) for side in high - low)
    (first, *others), turned = link.collisions, link.frame[:3, :3]
    level = np.allclose(turned @ first.origin.frame[:3, :3][:, 2], (0, 0, 1), atol=1e-6)
    upright = not others and first.kind == "cylinder" and bool(level)
    if upright:
        (radius,) = first.sizes["radius"]
        size = (2 * radius, 2 * radius, size[2])
    parts = moved(painted(link), -np.array([*(low + high)[:2] / 2, low[2]]))
    return Thing(parts, size, upright, mass)


def painted(link: Link) -> tuple[ColouredTriangles, ...]:
    """Return what a camera sees of a link: its visuals, or its collisions where there are none."""
    shapes: tuple[Shape, ...] = link.visuals or link.collisions
    found: dict[Numbers, ColouredTriangles] = {}
    for part in (part for shape in shapes for part in triangles_by_colour(shape, link.frame)):
        found[part.colour] = found[part.colour].joined(part) if part.colour in found else part
    return tuple(found.values())


def moved(parts: tuple[ColouredTriangles, ...], by: Points) -> tuple[ColouredTriangles, ...]:
    """Return parts that are moved by x, y, z in metres."""
    return tuple(replace(part, corners=part.corners + by) for part in parts)
