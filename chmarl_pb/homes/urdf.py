"""Read the URDF of a home into links with their convex solids, refusing what is unsafe or broken.

All that PyBullet will load is parsed here first, within limits: see :mod:`chmarl_pb.homes.plain`.
"""

import math
from collections import Counter
from dataclasses import dataclass
from xml.etree.ElementTree import Element

import numpy as np

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.mesh import MOST_TRIANGLES, Mesh
from chmarl_pb.homes.shape import SIZES, Numbers, Origin, Shape, numbers_of, read_mesh, read_origin, read_shape
from chmarl_pb.homes.solids import Points, Solid
from chmarl_pb.homes.source import Source, safe_xml

#: How many of each element a home may have.
MOST = {
    "link": 2000, "joint": 2000, "visual": 2000, "collision": 600, "mesh": 4000, "material": 4000, "texture": 4000,
}  # fmt: skip
#: Vertices of the mesh of one collision, and of all: of their convex hulls.
MOST_HULL_POINTS, MOST_POINTS_OF_HULLS = 4000, 20_000
#: Of all textures, three a pixel, as often as they are used: TinyRenderer copies one for each.
MOST_PICTURE_BYTES = 128 * 2**20

_LONGEST_LINE = 1000  # PyBullet by itself, in which homes work as well, cuts a URDF's lines at 1,023 characters
_LONGEST_VALUE = 400  # characters of an attribute
_SMALLEST = 1e-5  # metres
#: Element -> attribute -> how many finite numbers it holds.
_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "color": {"rgba": 4},
    "mass": {"value": 1},
}
_OPTIONAL = {"xyz", "rpy", "scale"}
_LENGTHS = {"size", "radius", "length"}


@dataclass(frozen=True, eq=False)
class Link:
    """One link of a home.

    Attributes:
        name: its name.
        frame: in the world, 4 x 4.
        origin: the same, as the URDF writes it where it is joined to the root.
        visuals: what a camera sees; if there are none, it sees the collisions.
        collisions: what is solid.
        solids: convex pieces of its collisions, in the world frame.
    """

    name: str
    frame: Points
    origin: Origin
    visuals: tuple[Shape, ...]
    collisions: tuple[Shape, ...]
    solids: tuple[Solid, ...]

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """All its visuals and collisions."""
        return self.visuals + self.collisions


def read_links(source: Source) -> tuple[Link, ...]:
    """Return all links of a home's URDF in the order of the file.

    Raises:
        HomeError: the file is missing, unsafe, not a URDF, too large, has a moving joint, a missing or
            outlying file, or geometry that cannot be used.
    """
    root = _root(source)
    label = str(source.urdf)
    _check_counts(label, root)
    _check_tree(label, root)
    _check_shapes(label, root)
    meshes = _meshes(label, root, source)
    _check_hulls(label, root, meshes)
    places = _places(label, root)
    colours = {material.get("name", ""): rgba for material in root.iter("material") if (rgba := _rgba(material))}
    return tuple(_link(label, link, *places[link.get("name", "")], colours, meshes) for link in root.findall("link"))


def _root(source: Source) -> Element:
    """Parse XML without DTDs and entities, and within what PyBullet can read."""
    text = source.read_urdf()
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _LONGEST_LINE:
            raise HomeError(
                f"{source.urdf}: line {number} has {len(line)} characters, but PyBullet reads at most {_LONGEST_LINE}; "
                "write one XML element on a line"
            )
    try:
        root = safe_xml(text)
    except ValueError as error:
        raise HomeError(f"{source.urdf}: {error}") from error
    if root.tag != "robot":
        raise HomeError(f"{source.urdf}: the root element is <{root.tag[:_LONGEST_VALUE]}>, a URDF has <robot>")
    if not root.get("name"):
        raise HomeError(
            f"{source.urdf}: PyBullet cannot load this URDF, for <robot> has no name; write <robot name=...>"
        )
    return root


def _check_counts(label: str, root: Element) -> None:
    """Check how much there is before anything is made of it."""
    counts = Counter(element.tag for element in root.iter())
    for tag, most in MOST.items():
        if counts[tag] > most:
            raise HomeError(
                f"{label}: {counts[tag]:,} <{tag}> elements, at most {most:,} are read; remove or join some"
            )
    for element in root.iter():
        for name, value in element.attrib.items():
            if len(value) > _LONGEST_VALUE or len(name) > _LONGEST_VALUE:
                raise HomeError(
                    f"{label}: <{element.tag[:40]} {name[:40]}={value[:40]!r}...> has {len(value):,} characters, "
                    f"at most {_LONGEST_VALUE} are read; shorten it"
                )


def _check_tree(path: str, root: Element) -> None:
    """Check that names are unique and that fixed joints make one tree of the links."""
    names = Counter(link.get("name", "") for link in root.findall("link"))
    for name, count in names.items():
        if not name or count > 1:
            raise HomeError(f"{path}: link {name!r} stands {count} times; give every link its own name")
    children: set[str] = set()
    joints: dict[str, str] = {}
    for joint in root.findall("joint"):
        label = f"{path}: joint {joint.get('name', '')!r}"
        _check_joint(label, joint, joints)
        for name in (_referred(joint, "parent"), child := _referred(joint, "child")):
            if name not in names:
                raise HomeError(f"{label} names the link {name!r}, which does not exist; add the link or the name")
        if child in children:
            raise HomeError(f"{label}: link {child!r} has a second parent; a URDF is a tree")
        children.add(child)
        joints[joint.get("name", "")] = child
    roots = [name for name in names if name not in children]
    if len(roots) != 1:
        raise HomeError(f"{path}: links {roots[:4]} have no parent; join all but one of them by fixed joints")


def _check_joint(label: str, joint: Element, others: dict[str, str]) -> None:
    """Check that a joint is fixed and that its name is none of the others, which tell their child's name."""
    name, child = joint.get("name", ""), _referred(joint, "child")
    if not name:
        raise HomeError(f"{label} to {child!r} has no name; give every joint its own")
    if name in others:
        raise HomeError(f"{label} stands twice, to {others[name]!r} and to {child!r}; give every joint its own name")
    if joint.get("type") != "fixed":
        raise HomeError(f"{label} is {joint.get('type')!r}; a home must not move, make it 'fixed'")


def _referred(joint: Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _check_shapes(path: str, root: Element) -> None:
    """Check that every geometry has one known shape, and that sizes, poses and colours are finite numbers."""
    for part in root:
        label = f"{path}: {part.tag} {part.get('name')!r}"
        for geometry in part.iter("geometry"):
            if len(geometry) != 1 or geometry[0].tag not in SIZES:
                raise HomeError(f"{label}: a <geometry> has one of {', '.join(sorted(SIZES))}; give it just one")
        for element in part.iter():
            for name, count in _NUMBERS.get(element.tag, {}).items():
                text = element.get(name)
                if text is not None or name not in _OPTIONAL:
                    _check_numbers(f"{label}: <{element.tag} {name}={text!r}>", name, count, text or "")


def _check_numbers(label: str, name: str, count: int, text: str) -> None:
    """Check the numbers of one attribute."""
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise HomeError(f"{label} is not {count} finite numbers; fix it")
    if name in _LENGTHS and not min(numbers) > 0:
        raise HomeError(f"{label} is not above 0; fix it")
    if name in _LENGTHS and min(numbers) < _SMALLEST:
        raise HomeError(f"{label} is below {_SMALLEST} m, too small to be there; make it larger or remove it")
    if name == "scale" and 0 in numbers:
        raise HomeError(f"{label} leaves nothing of the mesh; fix it")
    if name == "rgba" and not 0 <= min(numbers) <= max(numbers) <= 1:
        raise HomeError(f"{label} is not within 0 and 1; divide by 255 what counts to 255")


def _rgba(material: Element) -> Numbers:
    return numbers_of(material.find("color"), "rgba")


def _meshes(path: str, root: Element, source: Source) -> dict[str, Mesh]:
    """Read every mesh and texture that the URDF names; PyBullet draws textures of meshes alone."""
    meshes: dict[str, Mesh] = {}
    triangles, pictures = 0, 0
    for part in root:
        for element in (*part.iter("mesh"), *part.iter("texture")):
            name = element.get("filename", "")
            label = f"{path}: {part.tag} {part.get('name')!r}: {element.tag} {name!r}"
            try:
                if element.tag == "texture":
                    source.named(name)
                    continue
                if name not in meshes:
                    meshes[name] = read_mesh(name, source)
            except ValueError as error:
                raise HomeError(f"{label}: {_with_remedy(str(error), element.tag)}") from error
            triangles += len(meshes[name].corners)
            pictures += len(meshes[name].texture or b"")
            if triangles > MOST_TRIANGLES or pictures > MOST_PICTURE_BYTES:
                raise HomeError(
                    f"{label}: too much in all, with each mesh and its texture as often as they are used: at most "
                    f"{MOST_TRIANGLES:,} triangles and {MOST_PICTURE_BYTES // 3:,} pixels; make some smaller"
                )
    return meshes


def _check_hulls(path: str, root: Element, meshes: dict[str, Mesh]) -> None:
    """Check how many points the convex hulls of collisions are to be made of."""
    total = 0
    for part in root:
        for element in part.iterfind("collision/geometry/mesh"):
            name = element.get("filename", "")
            points = len(meshes[name].used_vertices)
            total += points
            if points > MOST_HULL_POINTS or total > MOST_POINTS_OF_HULLS:
                raise HomeError(
                    f"{path}: {part.tag} {part.get('name')!r}: mesh {name!r}: a collision has at most "
                    f"{MOST_HULL_POINTS:,} vertices, and all have {MOST_POINTS_OF_HULLS:,}; give it a simpler mesh"
                )


def _with_remedy(problem: str, tag: str) -> str:
    return f"{problem}; add the file or remove the {tag}" if problem.endswith("does not exist") else problem


def _places(path: str, root: Element) -> dict[str, tuple[Points, Origin]]:
    """Return the frame (4 x 4) of every link in the world, and its origin there."""
    joints = {
        _referred(joint, "child"): (_referred(joint, "parent"), read_origin(joint)) for joint in root.findall("joint")
    }
    places: dict[str, tuple[Points, Origin]] = {}
    for link in root.findall("link"):
        chain = [link.get("name", "")]
        while chain[-1] in joints and chain[-1] not in places:
            chain.append(joints[chain[-1]][0])
            if len(chain) > len(joints) + 1:
                raise HomeError(f"{path}: link {chain[0]!r} is its own ancestor; a URDF is a tree")
        for name in reversed(chain):
            if name not in places:
                places[name] = _place(*joints[name], joints, places) if name in joints else (np.eye(4), Origin())
    return places


def _place(
    parent: str, origin: Origin, joints: dict[str, tuple[str, Origin]], places: dict[str, tuple[Points, Origin]]
) -> tuple[Points, Origin]:
    frame = places[parent][0] @ origin.frame
    return frame, origin if parent not in joints else Origin.of(frame)


def _link(
    path: str, link: Element, frame: Points, origin: Origin, colours: dict[str, Numbers], meshes: dict[str, Mesh]
) -> Link:
    name = link.get("name", "")
    shapes: dict[str, list[Shape]] = {"visual": [], "collision": []}
    solids: list[Solid] = []
    for tag, found in shapes.items():
        for number, element in enumerate(link.findall(tag), start=1):
            try:
                shape = read_shape(element, colours, meshes)
                shape.check_place(frame)
                if tag == "collision":
                    solids.append(shape.solid(frame))
            except ValueError as error:
                raise HomeError(f"{path}: link {name!r}: {tag} {number}: {error}") from error
            found.append(shape)
    return Link(name, frame, origin, tuple(shapes["visual"]), tuple(shapes["collision"]), tuple(solids))
