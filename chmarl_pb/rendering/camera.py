"""Cameras drawn by PyBullet's TinyRenderer: RGB, depth and segmentation, without a display."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.rendering.placing import lens_of
from chmarl_pb.rendering.shading import Light
from chmarl_pb.rendering.triangles import Lens
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import Pose, Vector
from chmarl_pb.world.bullet import pybullet

_FLAGS = pybullet.ER_SEGMENTATION_MASK_OBJECT_AND_LINKINDEX
_SUN = (1.5, -2.0, 4.0)  # direction towards the light
_AMBIENT, _DIFFUSE, _SPECULAR = 0.62, 0.42, 0.05
_SHININESS = 2.0  # TinyRenderer's, for meshes without a specular map
# No shadows: they cost more than twice the time and would tie a static picture to what moves.
_LIGHT = {
    "shadow": 0,
    "lightDirection": _SUN,
    "lightColor": (1.0, 1.0, 1.0),
    "lightAmbientCoeff": _AMBIENT,
    "lightDiffuseCoeff": _DIFFUSE,
    "lightSpecularCoeff": _SPECULAR,
}


@dataclass(frozen=True)
class Camera:
    """A square pinhole camera.

    Attributes:
        fov: opening angle in degrees.
        near: distance of the near plane, metres.
        far: distance of the far plane, metres.
    """

    fov: float
    near: float = 0.05
    far: float = 30.0

    @property
    def projection(self) -> Vector:
        """The projection matrix, 16 numbers by column."""
        return _projection(self)

    def distance(self, depth: NDArray[np.float32]) -> NDArray[np.float32]:
        """Return metres along the line of sight from TinyRenderer's depth buffer."""
        near, far = self.near, self.far
        return (near * far / (far - (far - near) * depth)).clip(near, far).astype(np.float32)


@cache
def _projection(camera: Camera) -> Vector:
    return tuple(pybullet.computeProjectionMatrixFOV(camera.fov, 1.0, camera.near, camera.far))


@cache
def camera_of(model: RobotModel) -> Camera:
    """Return the camera of a kind of robot; where it is tells :meth:`chmarl_pb.robots.model.RobotModel.eye`."""
    return Camera(fov=model.camera.fov)


@dataclass(frozen=True, eq=False)
class Picture:
    """What a camera sees.

    Attributes:
        colour: (size, size) uint32, the four bytes of each pixel's RGBA as one number; (0, 0) if nobody wants colours.
        depth: (size, size) float32, TinyRenderer's depth buffer in [0, 1].
        segmentation: (size, size) integers; meaning as the maker of the picture says.
    """

    colour: NDArray[np.uint32]
    depth: NDArray[np.float32]
    segmentation: NDArray[np.integer]

    @property
    def rgb(self) -> NDArray[np.uint8]:
        """The colours as (size, size, 3) uint8."""
        return np.ascontiguousarray(self.colour.view(np.uint8).reshape(*self.colour.shape, 4)[..., :3])


def empty_picture(size: int) -> Picture:
    """Return a picture of nothing, of a width and height in pixels, which cannot be drawn on."""
    shape = (size, size)
    empty = Picture(np.zeros(shape, np.uint32), np.ones(shape, np.float32), np.full(shape, -1, np.int16))
    for array in (empty.colour, empty.depth, empty.segmentation):
        array.flags.writeable = False  # as kept views are: Numba compiles anew for arrays of another kind
    return empty


def view_matrix(eye: Pose) -> Vector:
    """Return the view matrix of a camera pose: looks along the frame's +x, its +z is up in the picture."""
    position, quaternion = eye
    rotation = np.array(pybullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
    target = np.asarray(position) + rotation[:, 0]
    return tuple(pybullet.computeViewMatrix(position, target.tolist(), rotation[:, 2].tolist()))


def lens(camera: Camera, view: Vector) -> Lens:
    """Return a camera at a pose as :func:`chmarl_pb.rendering.raster.draw` takes it.

    Args:
        camera: the camera.
        view: its view matrix.
    """
    return lens_of(_matrix(view), _matrix(camera.projection))


@cache
def light() -> Light:
    """Return the light of all pictures as :func:`chmarl_pb.rendering.raster.draw` takes it."""
    x, y, z = _SUN
    scale = 1 / np.sqrt(x * x + y * y + z * z)
    return Light(_floats((x * scale, y * scale, z * scale)), _floats((_AMBIENT, _DIFFUSE, _SPECULAR, _SHININESS)))


def _matrix(columns: Vector) -> NDArray[np.float32]:
    return np.ascontiguousarray(_floats(columns).reshape(4, 4).T)


def _floats(values: Vector) -> NDArray[np.float32]:
    return np.array(values, dtype=np.float32)


def render(client: int, camera: Camera, view: Vector, size: int) -> Picture:
    """Draw what a client holds; the segmentation is PyBullet's ``body + (link + 1) << 24``, -1 for nothing.

    Args:
        client: PyBullet client id.
        camera: the camera.
        view: its view matrix.
        size: width and height in pixels.
    """
    _, _, rgba, depth, segmentation = pybullet.getCameraImage(
        size, size, view, camera.projection, renderer=pybullet.ER_TINY_RENDERER, flags=_FLAGS,
        physicsClientId=client, **_LIGHT,
    )  # fmt: skip
    shape = (size, size)
    colour = np.ascontiguousarray(rgba, dtype=np.uint8).reshape(-1).view(np.uint32).reshape(shape)
    return Picture(
        colour,
        np.asarray(depth, dtype=np.float32).reshape(shape),
        np.asarray(segmentation, dtype=np.int32).reshape(shape),
    )
