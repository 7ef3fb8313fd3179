"""Draws what moves: one client per process with every graspable object and both robots, all hidden.

A view shows just the bodies in its frustum, at their poses, and hides the others: TinyRenderer skips
shapes whose alpha is 0. Merging by depth with the empty home gives the full picture.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
import pybullet

from chmarl_pb import catalog
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.drone import load_drone
from chmarl_pb.robots.humanoid import load_humanoid
from chmarl_pb.sensing.camera import Camera, Picture, render
from chmarl_pb.world import UPRIGHT, Pose, Vector, load_graspable, quiet


@dataclass(frozen=True, eq=False)
class _Body:
    """A hidden body: its visual shapes' colours, where its root frame lies, and how far it extends."""

    body: int
    shapes: tuple[tuple[int, int, Vector], ...]
    inertial: Vector
    radius: float


class Movables:
    """The process's client for moving bodies."""

    def __init__(self) -> None:
        """Load all graspables and robots, hidden."""
        self.client = pybullet.connect(pybullet.DIRECT)
        with quiet():
            objects = {f"{name}_1": load_graspable(self.client, name).body for name in catalog.GRASPABLES}
            robots = {"humanoid": load_humanoid(self.client), "drone": load_drone(self.client)}
        self.arm = Arm(self.client, robots["humanoid"])
        self._configuration = self.arm.configuration()
        bodies = {**objects, **robots}
        self._bodies = {name: self._body(name, body) for name, body in bodies.items()}
        self.names = tuple(bodies)
        self._index = np.full(max(bodies.values()) + 2, -1, dtype=np.int32)
        self._index[list(bodies.values())] = np.arange(len(bodies))
        self._radii = {name: body.radius for name, body in self._bodies.items()}
        self._shown: set[str] = set()
        for kept in self._bodies.values():
            self._show(kept, 0.0)

    def _body(self, name: str, body: int) -> _Body:
        shapes: list[tuple[int, int, Vector]] = []
        for data in pybullet.getVisualShapeData(body, physicsClientId=self.client):
            shapes.append((data[1], sum(shape[0] == data[1] for shape in shapes), data[7]))
        low, high = pybullet.getAABB(body, -1, physicsClientId=self.client)
        inertial = pybullet.getDynamicsInfo(body, -1, physicsClientId=self.client)[3]
        # A robot's reach around its origin; an object's collision box, with some allowance for what juts out.
        reach = {"humanoid": 2.2, "drone": 0.6}
        radius = reach.get(name, 0.05 + float(np.linalg.norm(np.subtract(high, low))))
        return _Body(body, tuple(shapes), inertial, radius)

    def in_view(self, camera: Camera, view: Vector, poses: dict[str, Pose]) -> list[str]:
        """Return the names whose bounding ball touches the camera's cone of view."""
        if not poses:
            return []
        names = list(poses)
        centres = np.array([poses[name][0] for name in names])
        radii = np.array([self._radii[name] for name in names])
        matrix = np.array(view).reshape(4, 4).T
        x, y, z = (centres @ matrix[:3, :3].T + matrix[:3, 3]).T
        slope = np.tan(np.radians(camera.fov) / 2)
        allowance = radii * np.hypot(1.0, slope)
        inside = (-z > -radii) & (np.abs(x) <= -z * slope + allowance) & (np.abs(y) <= -z * slope + allowance)
        return [name for name, seen in zip(names, inside, strict=True) if seen]

    def draw(
        self, camera: Camera, view: Vector, size: int, poses: dict[str, Pose], configuration: Configuration
    ) -> Picture:
        """Draw bodies alone on an empty background.

        Args:
            camera: the camera.
            view: its view matrix.
            size: width and height in pixels.
            poses: name -> pose of its origin, for each body to draw.
            configuration: of the humanoid's arm.

        Returns:
            The picture; its segmentation holds indices of ``names``, -1 for nothing.
        """
        for name in self._shown - poses.keys():
            self._show(self._bodies[name], 0.0)
        for name, pose in poses.items():
            self._put(self._bodies[name], *pose)
            if name not in self._shown:
                self._show(self._bodies[name], 1.0)
        self._shown = set(poses)
        if configuration != self._configuration:
            self.arm.set(configuration)
            self._configuration = configuration
        drawn = render(self.client, camera, view, size)
        # -1 (nothing) indexes the last entry, which is -1 as well.
        bodies = np.where(drawn.segmentation < 0, -1, drawn.segmentation & 0xFFFFFF)
        return Picture(drawn.colour, drawn.depth, self._index[bodies])

    def _put(self, kept: _Body, position: Vector, quaternion: Vector) -> None:
        centre, _ = pybullet.multiplyTransforms(position, quaternion, kept.inertial, UPRIGHT)
        pybullet.resetBasePositionAndOrientation(kept.body, centre, quaternion, physicsClientId=self.client)

    def _show(self, kept: _Body, alpha: float) -> None:
        for link, shape, colour in kept.shapes:
            pybullet.changeVisualShape(
                kept.body,
                link,
                shapeIndex=shape,
                rgbaColor=(*colour[:3], colour[3] * alpha),
                physicsClientId=self.client,
            )


@cache
def movables() -> Movables:
    """Return the process's drawer of moving bodies."""
    return Movables()


def merge(home: Picture, moving: Picture, first: int) -> Picture:
    """Return two pictures merged by depth.

    Args:
        home: the empty home; its segmentation is kept as it is.
        moving: the moving bodies; theirs is shifted by ``first``.
        first: segmentation value of the first moving body.
    """
    nearer = moving.depth < home.depth
    return Picture(
        np.where(nearer, moving.colour, home.colour),
        np.where(nearer, moving.depth, home.depth),
        np.where(nearer, moving.segmentation + np.int32(first), home.segmentation),
    )
