"""Furniture models: the URDF link of a model and the space that it takes."""

from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import trimesh
import yourdfpy

from chmarl_pb.catalog import BENCHMARK, Catalog, furniture_urdf
from chmarl_pb.errors import AssetError
from chmarl_pb.homes.shape import Shape
from chmarl_pb.homes.source import Source
from chmarl_pb.homes.urdf import Link, read_whole

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """A furniture model in its own frame: footprint centred on the origin, z = 0 at the bottom, front towards +x.

    Attributes:
        name: the model's name, ``<class>_<variant>``.
        thing_class: its class in the catalogue.
        link: its only link, with visuals and collisions.
        meshes: name and content of its mesh files and of what they need.
        low: smallest x, y, z of all its shapes, in metres.
        high: largest x, y, z of all its shapes, in metres.
    """

    name: str
    thing_class: str
    link: yourdfpy.Link
    meshes: dict[str, bytes]
    low: Array
    high: Array


def load_model(name: str, known: Catalog = BENCHMARK) -> Model:
    """Read a furniture model.

    Args:
        name: of a model of the package or of a catalogue file, or the path of a URDF.
        known: the classes of things.

    Raises:
        AssetError: there is no such model, its class is unknown or it has not exactly one link.
    """
    if name in known.furniture:
        thing_class, path = known.furniture[name]
        return _own_model(name, thing_class, path)
    if name.endswith(".urdf"):
        path = Path(name)
        listed = [row for row, urdf in known.furniture.values() if urdf == path.resolve()]
        return _own_model(path.stem, listed[0] if listed else _class_of_model(path.stem, path, known), path)
    return _packaged_model(name)


@cache
def _packaged_model(name: str) -> Model:
    path = furniture_urdf(name)
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=False, load_meshes=False).robot
    if len(robot.links) != 1:
        raise AssetError(f"{path}: {len(robot.links)} links; a furniture model has exactly one")
    link = robot.links[0]
    points = np.concatenate([_points(shape, path.parent) for shape in (*link.visuals, *link.collisions)])
    named = [shape.geometry.mesh.filename for shape in (*link.visuals, *link.collisions) if shape.geometry.mesh]
    meshes = {Path(file).name: (path.parent / file).read_bytes() for file in named}
    return Model(name, _class_of_model(name, path, BENCHMARK), link, meshes, points.min(axis=0), points.max(axis=0))


def _own_model(name: str, thing_class: str, path: Path) -> Model:
    """Read a user's model as homes are read; it stands with its middle on the origin, its meshes in plain files."""
    links = [link for link in read_whole(Source(path, "thing")) if link.visuals or link.collisions]
    if not links:
        raise AssetError(f"{path}: nothing in it has geometry; give its link a <visual> and a <collision>")
    points = np.concatenate([shape.points(link.frame) for link in links for shape in link.shapes])
    low, high = points.min(axis=0), points.max(axis=0)
    foot = np.array([*(low + high)[:2] / 2, low[2]])
    meshes: dict[str, bytes] = {}
    visuals, collisions = [], []
    for link in links:
        for shape in link.visuals:
            material = yourdfpy.Material("primary", yourdfpy.Color(np.array(shape.colour or (1.0, 1.0, 1.0, 1.0))))
            geometry = _geometry(shape, _kept(shape, True, meshes))
            visuals.append(yourdfpy.Visual(None, _placed(shape, link, foot), geometry, material))
        for shape in link.collisions:
            geometry = _geometry(shape, _kept(shape, False, meshes))
            collisions.append(yourdfpy.Collision(None, _placed(shape, link, foot), geometry))
    whole = yourdfpy.Link("base", visuals=visuals, collisions=collisions)
    return Model(name, thing_class, whole, meshes, low - foot, high - foot)


def _placed(shape: Shape, link: Link, foot: Array) -> Array:
    frame = link.frame @ shape.origin.frame
    frame[:3, 3] -= foot
    return np.asarray(frame)


def _kept(shape: Shape, visible: bool, meshes: dict[str, bytes]) -> str:
    """Note the files that the mesh of a shape needs, and return the name of the mesh; nothing if it has none."""
    if shape.mesh is None:
        return ""
    files = shape.mesh.drawn if visible else shape.mesh.solid
    meshes |= files
    return [*files][-1]


def _geometry(shape: Shape, file: str) -> yourdfpy.Geometry:
    sizes = {name: np.array(numbers) for name, numbers in shape.sizes.items()}
    if shape.kind == "mesh":
        return yourdfpy.Geometry(mesh=yourdfpy.Mesh(file, sizes["scale"]))
    if shape.kind == "box":
        return yourdfpy.Geometry(box=yourdfpy.Box(sizes["size"]))
    (radius,) = shape.sizes["radius"]
    if shape.kind == "sphere":
        return yourdfpy.Geometry(sphere=yourdfpy.Sphere(radius))
    return yourdfpy.Geometry(cylinder=yourdfpy.Cylinder(radius, shape.sizes["length"][0]))


def _class_of_model(name: str, path: Path, known: Catalog) -> str:
    """Return the longest class that the model's name starts with: ``tv_stand_low`` -> ``tv_stand``."""
    classes = [row for row in (*known.receptacles, *known.scenery) if f"{name}_".startswith(f"{row}_")]
    if not classes:
        raise AssetError(
            f"{path}: its class is not known; name the file <class>_<variant>, with a receptacle or scenery class, or "
            "list it among the models of a row of a catalogue file"
        )
    return max(classes, key=len)


def _points(shape: yourdfpy.Visual | yourdfpy.Collision, folder: Path) -> Array:
    """Return points whose hull holds a shape, in the link's frame, one a row, in metres."""
    geometry = shape.geometry
    if geometry.mesh is not None:
        mesh: Any = trimesh.load(folder / geometry.mesh.filename, force="mesh", process=False)
        points = mesh.vertices * (1.0 if geometry.mesh.scale is None else geometry.mesh.scale)
    else:
        points = np.array(list(product((-0.5, 0.5), repeat=3))) * _size(geometry)
    origin = np.eye(4) if shape.origin is None else shape.origin
    return np.asarray(points @ origin[:3, :3].T + origin[:3, 3])


def _size(geometry: yourdfpy.Geometry) -> Array:
    """Return the edge lengths of the box around a primitive shape, in metres."""
    if geometry.box is not None:
        return np.asarray(geometry.box.size, dtype=float)
    if geometry.cylinder is not None:
        width = 2 * geometry.cylinder.radius
        return np.array([width, width, geometry.cylinder.length])
    return np.full(3, 2 * geometry.sphere.radius)
