"""Read the URDF of a home into links with their convex solids, refusing what is unsafe or broken."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import defusedxml.ElementTree
import numpy as np
import trimesh
import yourdfpy
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
_OPTIONAL = {"xyz", "rpy", "scale"}


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
    model = _parse(path)
    frames = _frames(path, model)
    return tuple(_link(path, link, frames[link.name]) for link in model.links)


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


def _are_numbers(text: str, count: int) -> bool:
    try:
        values = [float(word) for word in text.split()]
    except ValueError:
        return False
    return len(values) == count and bool(np.isfinite(values).all())


def _parse(path: Path) -> Any:
    try:
        return yourdfpy.URDF.load(
            str(path), build_scene_graph=False, load_meshes=False, build_collision_scene_graph=False
        ).robot
    except Exception as error:  # yourdfpy raises whatever its parsing meets
        raise HomeError(f"{path}: not a URDF that can be read ({error}); compare it with a packaged home") from error


def _frames(path: Path, model: Any) -> dict[str, Points]:
    """Return the world frame (4 x 4) of every link."""
    joints = {joint.child: joint for joint in model.joints}
    frames: dict[str, Points] = {}
    for link in model.links:
        chain = [link.name]
        while chain[-1] in joints and chain[-1] not in frames:
            chain.append(joints[chain[-1]].parent)
            if len(chain) > len(model.links):
                raise HomeError(f"{path}: link {link.name!r} is its own ancestor; a URDF is a tree")
        for name in reversed(chain):
            if name not in frames:
                joint = joints.get(name)
                origin = np.eye(4) if joint is None or joint.origin is None else joint.origin
                frames[name] = origin if joint is None else frames[joint.parent] @ origin
    return frames


def _link(path: Path, link: Any, frame: Points) -> Link:
    solids = []
    for number, collision in enumerate(link.collisions, start=1):
        origin = np.eye(4) if collision.origin is None else collision.origin
        try:
            corners = _vertices(path, collision.geometry)
            placed = trimesh.transform_points(corners, frame @ origin)
            if not np.isfinite(placed).all():
                raise ValueError("its size or pose is not a finite number")
            solids.append(solid_from_vertices(placed))
        except ValueError as error:
            raise HomeError(f"{path}: link {link.name!r}: collision {number}: {error}") from error
    return Link(link.name, frame, tuple(solids), bool(link.visuals))


def _vertices(path: Path, geometry: Any) -> Points:
    """Return points (n, 3) whose convex hull is the geometry, in its own frame."""
    if geometry.box is not None:
        return np.asarray(trimesh.creation.box(np.asarray(geometry.box.size, dtype=float)).vertices)
    if geometry.cylinder is not None:
        shape = trimesh.creation.cylinder(geometry.cylinder.radius, geometry.cylinder.length, sections=24)
        return np.asarray(shape.vertices)
    if geometry.sphere is not None:
        return np.asarray(trimesh.creation.icosphere(subdivisions=2, radius=geometry.sphere.radius).vertices)
    if geometry.mesh is not None:
        return _mesh_vertices(path.parent / geometry.mesh.filename, geometry.mesh.scale)
    raise ValueError("it has no geometry; use box, cylinder, sphere or mesh")


def _mesh_vertices(file: Path, scale: Any) -> Points:
    try:
        mesh: Any = trimesh.load(file, force="mesh", process=False)
    except Exception as error:  # the loaders of the formats raise what they like
        raise ValueError(f"mesh {file.name!r} cannot be read ({error})") from error
    if not len(getattr(mesh, "vertices", ())):
        raise ValueError(f"mesh {file.name!r} is empty")
    factor = np.ones(3) if scale is None else np.broadcast_to(np.asarray(scale, dtype=float), 3)
    return np.asarray(mesh.vertices) * factor
