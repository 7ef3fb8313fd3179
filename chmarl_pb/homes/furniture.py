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

from chmarl_pb.catalog import RECEPTACLES, SCENERY, furniture_urdf
from chmarl_pb.errors import AssetError

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Model:
    """A furniture model in its own frame: footprint centred on the origin, z = 0 at the bottom, front towards +x.

    Attributes:
        name: the model's name, ``<class>_<variant>``.
        thing_class: its class in the catalogue.
        link: its only link, with visuals and collisions.
        folder: where its mesh paths start.
        low: smallest x, y, z of all its shapes, in metres.
        high: largest x, y, z of all its shapes, in metres.
    """

    name: str
    thing_class: str
    link: yourdfpy.Link
    folder: Path
    low: Array
    high: Array


@cache
def load_model(name: str) -> Model:
    """Read a furniture model.

    Raises:
        AssetError: there is no such model, its class is unknown or it has not exactly one link.
    """
    path = furniture_urdf(name)
    robot = yourdfpy.URDF.load(str(path), build_scene_graph=False, load_meshes=False).robot
    if len(robot.links) != 1:
        raise AssetError(f"{path}: {len(robot.links)} links; a furniture model has exactly one")
    link = robot.links[0]
    points = np.concatenate([_points(shape, path.parent) for shape in (*link.visuals, *link.collisions)])
    return Model(name, _class_of_model(name, path), link, path.parent, points.min(axis=0), points.max(axis=0))


def _class_of_model(name: str, path: Path) -> str:
    """Return the longest class that the model's name starts with: ``tv_stand_low`` -> ``tv_stand``."""
    classes = [known for known in (*RECEPTACLES, *SCENERY) if name.startswith(f"{known}_")]
    if not classes:
        raise AssetError(f"{path}: the name of a model is <class>_<variant>, with a receptacle or scenery class")
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
