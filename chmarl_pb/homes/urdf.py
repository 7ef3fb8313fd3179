"""Read the URDF of a home into links with their convex solids, refusing what is unsafe or broken."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import defusedxml.ElementTree
import numpy as np
from defusedxml import DefusedXmlException

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.solids import Points, Solid, solid_from_vertices

_LONGEST_LINE = 1000  # PyBullet reads a URDF in lines of 1,023 characters and breaks longer ones
_MESH_ENDINGS = {".obj", ".stl", ".dae"}
_SHAPES = {"box", "cylinder", "sphere", "mesh"}
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
#: Corners of boxes and cylinders of size 1, the latter as a prism of 24 sides.
_BOX = np.array(list(product((-0.5, 0.5), repeat=3)))
_CYLINDER = np.array(
    [(np.cos(angle), np.sin(angle), z) for angle in np.linspace(0, 2 * np.pi, 25)[:-1] for z in (-0.5, 0.5)]
)
_OPTIONAL = {"xyz", "rpy", "scale"}
_SIZES = {"size", "radius", "length"}


@dataclass(frozen=True, eq=False)
class Link:
    """One link of a home: its name, its frame in the world (4 x 4) and its geometry.

    Attributes:
        solids: convex pieces of its collision geometry, in the world frame.
        has_visual: whether a camera can see it.
    """

    name: str
    frame: Points
    solids: tuple[Solid, ...]
    has_visual: bool


def read_links(path: Path) -> tuple[Link, ...]:
    """Return all links of a home's URDF in the order of the file.

    Raises:
        HomeError: the file is missing, unsafe, not a URDF, has a moving joint, a missing or
            outlying mesh, or geometry that cannot be used.
    """
    root = _safe_root(path)
    _check_tree(path, root)
    _check_files(path, root)
    _check_shapes(path, root)
    frames = _frames(path, root)
    return tuple(_link(path, link, frames[link.get("name", "")]) for link in root.findall("link"))


def _safe_root(path: Path) -> ElementTree.Element:
    """Parse XML without DTDs and entities, and within what PyBullet can read."""
    if not path.is_file():
        raise HomeError(f"{path}: no such file; `chmarl-pb homes list` names the homes that come with the package")
    text = path.read_bytes()
    for number, line in enumerate(text.splitlines(), start=1):
        if len(line) > _LONGEST_LINE:
            raise HomeError(
                f"{path}: line {number} has {len(line)} characters, but PyBullet reads at most {_LONGEST_LINE}; "
                "write one XML element on a line"
            )
    try:
        root = defusedxml.ElementTree.fromstring(text, forbid_dtd=True)
    except DefusedXmlException as error:
        raise HomeError(f"{path}: document types and entities are refused ({error}); remove the <!DOCTYPE>") from error
    except (ElementTree.ParseError, ValueError) as error:
        raise HomeError(f"{path}: not XML ({error}); mend the file at that place") from error
    if root.tag != "robot":
        raise HomeError(f"{path}: the root element is <{root.tag}>, a URDF has <robot>")
    return root


def _check_tree(path: Path, root: ElementTree.Element) -> None:
    """Check that link names are unique and that fixed joints make one tree of them."""
    names = [link.get("name", "") for link in root.findall("link")]
    for name in names:
        if not name or names.count(name) > 1:
            raise HomeError(f"{path}: link {name!r} stands {names.count(name)} times; give every link its own name")
    children: dict[str, str] = {}
    for joint in root.findall("joint"):
        label = f"{path}: joint {joint.get('name', '')!r}"
        if not joint.get("name"):
            raise HomeError(f"{label} to {_referred(joint, 'child')!r} has no name; give every joint its own")
        if joint.get("type") != "fixed":
            raise HomeError(f"{label} is {joint.get('type')!r}; a home must not move, make it 'fixed'")
        parent, child = (_referred(joint, end) for end in ("parent", "child"))
        for name in (parent, child):
            if name not in names:
                raise HomeError(f"{label} names the link {name!r}, which does not exist; add the link or the name")
        if child in children:
            raise HomeError(f"{label}: link {child!r} has a second parent; a URDF is a tree")
        children[child] = parent
    roots = [name for name in names if name not in children]
    if len(roots) != 1:
        raise HomeError(f"{path}: links {roots[:4]} have no parent; join all but one of them by fixed joints")


def _referred(joint: ElementTree.Element, end: str) -> str:
    element = joint.find(end)
    return "" if element is None else element.get("link", "")


def _check_files(path: Path, root: ElementTree.Element) -> None:
    """Check that every mesh and texture is a file inside the home's folder, and every mesh of a known kind."""
    folder = path.resolve().parent
    for part in root:
        for element in (*part.iter("mesh"), *part.iter("texture")):
            name = element.get("filename", "")
            label = f"{path}: {part.tag} {part.get('name')!r}: {element.tag} {name!r}"
            target = (folder / name).resolve()
            if "://" in name or not target.is_relative_to(folder):
                raise HomeError(f"{label} leaves the home's folder; copy it beside the URDF and use a relative path")
            if element.tag == "mesh" and target.suffix.lower() not in _MESH_ENDINGS:
                raise HomeError(f"{label} is of an unknown kind; use {', '.join(sorted(_MESH_ENDINGS))}")
            if not target.is_file():
                raise HomeError(f"{label} does not exist; add the file {target.name} or remove the {element.tag}")
            for inner in referred_files(target):
                if not (target.parent / inner).resolve().is_relative_to(folder):
                    raise HomeError(f"{label} refers to {inner!r}, which leaves the home's folder; copy it there")


def referred_files(file: Path) -> Iterator[str]:
    """Yield the files that an OBJ mesh names: its material libraries, and their textures."""
    if file.suffix.lower() not in (".obj", ".mtl") or not file.is_file():
        return
    for line in file.read_text(encoding="utf-8", errors="replace").splitlines():
        keyword, _, name = line.strip().partition(" ")
        if keyword == "mtllib":
            yield name
            yield from referred_files(file.parent / name)
        elif keyword.startswith(("map_", "bump", "disp", "decal", "refl")):
            yield name.split()[-1] if name.split() else ""


def _check_shapes(path: Path, root: ElementTree.Element) -> None:
    """Check that every geometry has one known shape, and that sizes, poses and colours are finite numbers."""
    for part in root:
        label = f"{path}: {part.tag} {part.get('name')!r}"
        for geometry in part.iter("geometry"):
            if len(geometry) != 1 or geometry[0].tag not in _SHAPES:
                raise HomeError(f"{label}: a <geometry> has one of {', '.join(sorted(_SHAPES))}; give it just one")
        for element in part.iter():
            for name, count in _NUMBERS.get(element.tag, {}).items():
                text = element.get(name)
                if not (_are_numbers(text, count) if text is not None else name in _OPTIONAL):
                    raise HomeError(f"{label}: <{element.tag} {name}={text!r}> is not {count} finite numbers; mend it")
                if name in _SIZES and not (_numbers(element, name) > 0).all():
                    raise HomeError(f"{label}: <{element.tag} {name}={text!r}> is not above 0; mend it")


def _are_numbers(text: str, count: int) -> bool:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return False
    return len(values) == count and bool(np.isfinite(values).all())


def _frames(path: Path, root: ElementTree.Element) -> dict[str, Points]:
    """Return the world frame (4 x 4) of every link."""
    joints = {
        _referred(joint, "child"): (_referred(joint, "parent"), _origin(joint)) for joint in root.findall("joint")
    }
    frames: dict[str, Points] = {}
    for link in root.findall("link"):
        chain = [link.get("name", "")]
        while chain[-1] in joints and chain[-1] not in frames:
            chain.append(joints[chain[-1]][0])
            if len(chain) > len(joints) + 1:
                raise HomeError(f"{path}: link {chain[0]!r} is its own ancestor; a URDF is a tree")
        for name in reversed(chain):
            if name not in frames:
                frames[name] = frames[joints[name][0]] @ joints[name][1] if name in joints else np.eye(4)
    return frames


def _origin(element: ElementTree.Element) -> Points:
    """Return the frame (4 x 4) in the <origin> of a joint or a shape; none means the parent's own frame."""
    origin = element.find("origin")
    frame = np.eye(4)
    if origin is not None:
        turns = _numbers(origin, "rpy", "0 0 0")
        (si, sj, sk), (ci, cj, ck) = np.sin(turns), np.cos(turns)
        frame[0, :3] = cj * ck, sj * (si * ck) - ci * sk, sj * (ci * ck) + si * sk
        frame[1, :3] = cj * sk, sj * (si * sk) + ci * ck, sj * (ci * sk) - si * ck
        frame[2, :3] = -sj, cj * si, cj * ci
        frame[:3, 3] = _numbers(origin, "xyz", "0 0 0")
    return frame + 0.0  # without negative zeros


def _numbers(element: ElementTree.Element, name: str, default: str = "") -> Points:
    return np.array([float(word) for word in element.get(name, default).split()])


def _link(path: Path, link: ElementTree.Element, frame: Points) -> Link:
    name, solids = link.get("name", ""), []
    for number, collision in enumerate(link.findall("collision"), start=1):
        try:
            corners = _vertices(path, collision)
            placed = (frame @ _origin(collision) @ np.column_stack([corners, np.ones(len(corners))]).T).T[:, :3]
            if not np.isfinite(placed).all():
                raise ValueError("its size or pose is not a finite number")
            solids.append(solid_from_vertices(placed))
        except ValueError as error:
            raise HomeError(f"{path}: link {name!r}: collision {number}: {error}") from error
    return Link(name, frame, tuple(solids), link.find("visual") is not None)


def _vertices(path: Path, collision: ElementTree.Element) -> Points:
    """Return points (n, 3) whose convex hull is the geometry, in its own frame."""
    shape = collision.find("geometry/*")
    if shape is None:
        raise ValueError("it has no geometry; use box, cylinder, sphere or mesh")
    if shape.tag == "box":
        return _BOX * _numbers(shape, "size")
    if shape.tag == "cylinder":
        radius, length = float(shape.get("radius", "")), float(shape.get("length", ""))
        return _CYLINDER * (radius, radius, length)
    import trimesh  # only here: it takes a while to load, and most homes are boxes and cylinders

    if shape.tag == "sphere":
        radius = float(shape.get("radius", ""))
        return np.asarray(trimesh.creation.icosphere(subdivisions=2, radius=radius).vertices)
    file = path.parent / shape.get("filename", "")
    try:
        mesh: Any = trimesh.load(file, force="mesh", process=False)
    except Exception as error:  # the loaders of the formats raise what they like
        raise ValueError(f"mesh {file.name!r} cannot be read ({error})") from error
    if not len(getattr(mesh, "vertices", ())):
        raise ValueError(f"mesh {file.name!r} is empty")
    return np.asarray(mesh.vertices) * _numbers(shape, "scale", "1 1 1")
