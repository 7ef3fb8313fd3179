"""Bodies in a PyBullet client: poses, loading a home and graspable objects."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.catalog import Catalog
from chmarl_pb.errors import AssetError, HomeError
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.plain import plain_copy, plain_files
from chmarl_pb.navigation.free_space import Size
from chmarl_pb.world.bullet import pybullet, quiet

Vector = tuple[float, ...]
Pose = tuple[Vector, Vector]  # position in metres, orientation (x, y, z, w)
UPRIGHT: Vector = (0.0, 0.0, 0.0, 1.0)

_PARKING = (0.0, 0.0, 50.0)  # metres: objects that a task does not use wait here, unseen and untouched


@dataclass(frozen=True)
class Graspable:
    """What physics knows of a graspable object: body, mass, size, and its frame.

    Attributes:
        body: PyBullet body id.
        mass: kilograms.
        size: extents x, y, z of its collision shape, metres; its origin is the bottom's centre.
        inertial: position of its inertial frame in its own frame, metres.
        parking: where its centre of mass waits while no task uses it, metres.
    """

    body: int
    mass: float
    size: Size
    inertial: Vector
    parking: Vector


@lru_cache(maxsize=4096)
def yaw_quaternion(yaw: float) -> Vector:
    """Return the orientation (x, y, z, w) of a turn by ``yaw`` radians about z."""
    return (0.0, 0.0, float(np.sin(yaw / 2)), float(np.cos(yaw / 2)))


@contextmanager
def loaded_home(client: int, home: Home) -> Iterator[int]:
    """Load a home into a client and yield its body id; while the context lasts, its meshes are where PyBullet says.

    Raises:
        HomeError: PyBullet cannot load it.
    """
    with _plain_file(home) as urdf:
        try:
            with quiet():
                body = int(pybullet.loadURDF(str(urdf), useFixedBase=True, physicsClientId=client))
        except pybullet.error as error:
            raise HomeError(f"{home.path}: PyBullet cannot load this home ({error}); make it simpler") from error
        yield body


@contextmanager
def _plain_file(home: Home) -> Iterator[Path]:
    """Yield a URDF for PyBullet: a plain copy; of a home of the package, where no file can be written, its own."""
    with ExitStack() as stack:
        try:
            urdf = stack.enter_context(plain_copy(home.links))
        except HomeError:
            if home.path.parent != SCENES_DIR:
                raise
            urdf = home.path
        yield urdf


@contextmanager
def loaded_graspables(client: int, known: Catalog) -> Iterator[dict[str, Graspable]]:
    """Load the objects of every graspable class, parked and frozen, and yield them by their names.

    While the context lasts, their meshes are where PyBullet says.

    Raises:
        AssetError: a URDF is missing or is not one link with one collision shape.
    """
    models = [(name, row.name, files) for row in known.graspables.values() for name, files in row.objects]
    own = {file: content for _, _, files in models for file, content in files}
    with plain_files(own) if own else nullcontext(Path()) as folder:
        x, y, z = _PARKING
        yield {
            name: _load_graspable(
                client, folder / files[0][0] if files else catalog.graspable_urdf(kind), (x, y, z + 0.5 * place)
            )
            for place, (name, kind, files) in enumerate(models)
        }


def _load_graspable(client: int, path: Path, parked: Vector) -> Graspable:
    flags = pybullet.URDF_USE_IMPLICIT_CYLINDER  # else a cylinder becomes a hull of unknown size
    body = pybullet.loadURDF(str(path), parked, flags=flags, physicsClientId=client)
    parking, _ = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
    dynamics = pybullet.getDynamicsInfo(body, -1, physicsClientId=client)
    shapes = pybullet.getCollisionShapeData(body, -1, physicsClientId=client)
    if len(shapes) != 1 or pybullet.getNumJoints(body, physicsClientId=client):
        raise AssetError(f"{path}: a graspable has one link with one collision shape, a box or a cylinder")
    _, _, kind, size, *_ = shapes[0]
    if kind == pybullet.GEOM_CYLINDER:
        size = (2 * size[1], 2 * size[1], size[0])  # PyBullet gives height, radius
    pybullet.changeDynamics(body, -1, mass=0, physicsClientId=client)
    return Graspable(body, dynamics[0], (size[0], size[1], size[2]), dynamics[3], parking)


def link_names(client: int, body: int) -> Iterator[str]:
    """Yield the child link's name of every joint, in PyBullet's order of link indices."""
    for joint in range(pybullet.getNumJoints(body, physicsClientId=client)):
        yield pybullet.getJointInfo(body, joint, physicsClientId=client)[12].decode()
