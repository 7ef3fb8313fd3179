"""The shapes of a home, visible or solid: boxes, cylinders, spheres and meshes at their places."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product
from pathlib import Path, PurePath
from typing import NamedTuple
from xml.etree.ElementTree import Element

import numpy as np

from chmarl_pb.homes.dae import read_dae
from chmarl_pb.homes.mesh import Mesh, checked, read_stl
from chmarl_pb.homes.solids import Points, Solid, prism, solid_from_vertices
from chmarl_pb.homes.source import Source
from chmarl_pb.homes.wavefront import read_obj

#: Metres from the world's origin within which every shape lies.
FARTHEST = 1000

Numbers = tuple[float, ...]

_READERS: dict[str, Callable[[bytes, Path, Source], Mesh]] = {
    ".obj": read_obj,
    ".stl": lambda content, *_: checked(read_stl(content)),
    ".dae": lambda content, *_: checked(read_dae(content)),
}
#: The attributes of each kind of shape that hold its size.
SIZES = {"box": ("size",), "cylinder": ("radius", "length"), "sphere": ("radius",), "mesh": ("scale",)}
#: Corners of boxes and cylinders of size 1, the latter as a prism of 24 sides.
_BOX = np.array(list(product((-0.5, 0.5), repeat=3)))
_CYLINDER = np.array(
    [(np.cos(angle), np.sin(angle), z) for angle in np.linspace(0, 2 * np.pi, 25)[:-1] for z in (-0.5, 0.5)]
)
#: Which of these corners follow each other round the foot, counter-clockwise from above.
_RINGS = {"box": [0, 4, 6, 2], "cylinder": [*range(0, 48, 2)]}


class Origin(NamedTuple):
    """A place in its parent's frame: metres, and radians of roll, pitch and yaw, as a URDF writes it."""

    xyz: Numbers = (0.0, 0.0, 0.0)
    rpy: Numbers = (0.0, 0.0, 0.0)

    @property
    def frame(self) -> Points:
        """The same as a matrix (4 x 4), not to be changed."""
        return _frame_of(self)

    @staticmethod
    def of(frame: Points) -> "Origin":
        """Return the origin of a frame (4 x 4)."""
        level = float(np.hypot(frame[0, 0], frame[1, 0]))
        if level > 1e-9:
            roll, yaw = np.arctan2(frame[2, 1], frame[2, 2]), np.arctan2(frame[1, 0], frame[0, 0])
        else:  # looking straight up or down, where both turn about one axis
            roll, yaw = np.arctan2(-frame[1, 2], frame[1, 1]), 0.0
        return Origin(tuple(frame[:3, 3].tolist()), (float(roll), float(np.arctan2(-frame[2, 0], level)), float(yaw)))


_NOWHERE = Origin()


@lru_cache(maxsize=4096)
def _frame_of(origin: Origin) -> Points:
    """Return an origin as a matrix; most shapes of furniture have one of a few."""
    frame = np.eye(4)
    (si, sj, sk), (ci, cj, ck) = np.sin(origin.rpy), np.cos(origin.rpy)
    frame[0, :3] = cj * ck, sj * (si * ck) - ci * sk, sj * (ci * ck) + si * sk
    frame[1, :3] = cj * sk, sj * (si * sk) + ci * ck, sj * (ci * sk) - si * ck
    frame[2, :3] = -sj, cj * si, cj * ci
    frame[:3, 3] = origin.xyz
    frame += 0.0  # without negative zeros
    frame.flags.writeable = False
    return frame


@dataclass(frozen=True, eq=False)
class Shape:
    """One <visual> or <collision>.

    Attributes:
        kind: box, cylinder, sphere or mesh.
        sizes: the attributes of its element: extents, radius and length in metres, or the scale of a mesh.
        origin: its place in its link.
        colour: red, green, blue, alpha in 0..1; None: white.
        mesh: its triangles, unscaled.
    """

    kind: str
    sizes: dict[str, Numbers]
    origin: Origin
    colour: Numbers | None = None
    mesh: Mesh | None = None

    @property
    def in_colours(self) -> "tuple[Shape, ...]":
        """The same as a shape for each colour of its mesh; a colour of its own is that of all."""
        if self.mesh is None or self.mesh.paint is None or self.colour is not None:
            return (self,)
        return tuple(
            replace(self, colour=colour and (*colour, 1.0), mesh=mesh) for colour, mesh in self.mesh.in_colours
        )

    def solid(self, frame: Points) -> Solid:
        """Return its convex hull in the world, from its link's frame.

        Raises:
            ValueError: it spans no volume.
        """
        place, ring = frame @ self.origin.frame, _RINGS.get(self.kind)
        points = (place @ self._hull_points().T).T[:, :3]
        if ring is not None and place[:3, 2].tolist() == [0.0, 0.0, 1.0]:
            corners = points.tolist()
            heights = [z for _, _, z in corners]
            return prism([corners[number][:2] for number in ring], min(heights), max(heights))
        return solid_from_vertices(points)

    def check_place(self, frame: Points) -> None:
        """Check that it lies near the world's origin, from its link's frame.

        Raises:
            ValueError: it does not.
        """
        reach = math.hypot(*self._reach())
        if math.hypot(*frame[:3, 3].tolist()) + math.hypot(*self.origin.xyz) + reach < FARTHEST / 2:
            return  # however the link is turned
        centre = (frame[:3, :3] @ self.origin.xyz + frame[:3, 3]).tolist()
        if not math.hypot(*centre) + reach <= FARTHEST:  # False for NaN, too
            raise ValueError(f"it reaches farther than {FARTHEST:,} m from the origin; a URDF's unit is the metre")

    def points(self, frame: Points) -> Points:
        """Return points (n, 3) in the world whose convex hull it is, from its link's frame."""
        return (frame @ self.origin.frame @ self._hull_points().T).T[:, :3]

    def triangles(self, frame: Points) -> Points:
        """Return the corners (n, 3, 3) in the world of a mesh's triangles, from its link's frame."""
        assert self.mesh is not None
        points = _with_ones(self.mesh.vertices * self.sizes["scale"])
        return (frame @ self.origin.frame @ points.T).T[self.mesh.corners[..., 0], :3]

    def _reach(self) -> Numbers:
        """Return how far from its origin, in metres along each axis, a box ends that holds it however it is turned."""
        if self.mesh is not None:
            return tuple(size * scale for size, scale in zip(self.mesh.reach, self.sizes["scale"], strict=True))
        return tuple(number for numbers in self.sizes.values() for number in numbers)

    def _hull_points(self) -> Points:
        """Return points (n, 4) whose convex hull it is, in its own frame, each with a 1 behind it."""
        if self.mesh is not None:
            return _with_ones(self.mesh.used_vertices * self.sizes["scale"])
        if self.kind == "box":
            return _corners(self.kind, self.sizes["size"])
        (radius,) = self.sizes["radius"]
        if self.kind == "cylinder":
            return _corners(self.kind, (radius, radius, self.sizes["length"][0]))
        import trimesh  # only here: it takes a while to load, and most homes are boxes and cylinders

        return _with_ones(np.asarray(trimesh.creation.icosphere(subdivisions=2, radius=radius).vertices))


@lru_cache(maxsize=4096)
def _corners(kind: str, extents: Numbers) -> Points:
    """Return the corners of a box or cylinder, each with a 1 behind it; most of furniture have one of a few sizes."""
    return _with_ones((_BOX if kind == "box" else _CYLINDER) * extents)


def _with_ones(points: Points) -> Points:
    return np.column_stack([points, np.ones(len(points))])


def read_mesh(name: str, source: Source) -> Mesh:
    """Return the mesh in a file that a URDF names.

    Raises:
        ValueError: the file, or one that it names, cannot be used.
    """
    reader = _READERS.get(PurePath(name).suffix.lower())
    if reader is None:
        source.inside(source.urdf.parent, name)
        raise ValueError(f"is of an unknown kind; use {', '.join(_READERS)}")
    path, content = source.named(name)
    return reader(content, path, source)


def numbers_of(element: Element | None, name: str, default: Numbers = ()) -> Numbers:
    """Return the numbers of an attribute."""
    text = None if element is None else element.get(name)
    return default if text is None else _numbers_in(text)


@lru_cache(maxsize=2**14)
def _numbers_in(text: str) -> Numbers:
    return tuple(float(word) for word in text.split())


def read_origin(element: Element) -> Origin:
    """Return the <origin> of a joint or a shape; none means the parent's own frame."""
    origin = element.find("origin")
    return Origin(numbers_of(origin, "xyz", _NOWHERE.xyz), numbers_of(origin, "rpy", _NOWHERE.rpy))


def read_shape(element: Element, colours: Mapping[str, Numbers], meshes: Mapping[str, Mesh]) -> Shape:
    """Return a <visual> or <collision> whose numbers have been checked.

    Args:
        element: the XML.
        colours: the colour of each material that has a name.
        meshes: the mesh of each file name.

    Raises:
        ValueError: it has no geometry.
    """
    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        raise ValueError("it has no geometry; use box, cylinder, sphere or mesh")
    shape = geometry[0]
    if shape.tag not in SIZES or (shape.tag == "mesh" and shape.get("filename", "") not in meshes):
        raise ValueError(f"its geometry <{shape.tag[:40]}> cannot be read; use one box, cylinder, sphere or mesh")
    sizes = tuple([numbers_of(shape, name, (1.0, 1.0, 1.0)) for name in SIZES[shape.tag]])
    material = element.find("material")
    own = () if material is None else numbers_of(material.find("color"), "rgba")
    colour = own or (None if material is None else colours.get(material.get("name", "")))
    mesh = meshes[shape.get("filename", "")] if shape.tag == "mesh" else None
    make = _shape if mesh is None else _shape.__wrapped__  # a mesh may be large: it is not to outlive its home
    return make(shape.tag, sizes, read_origin(element), colour, mesh)


@lru_cache(maxsize=4096)
def _shape(kind: str, sizes: tuple[Numbers, ...], origin: Origin, colour: Numbers | None, mesh: Mesh | None) -> Shape:
    """Return a shape; homes share those of their furniture."""
    return Shape(kind, dict(zip(SIZES[kind], sizes, strict=True)), origin, colour, mesh)
