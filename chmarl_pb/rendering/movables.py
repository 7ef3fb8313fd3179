"""What moves: the models of every graspable object and of the robots, and where they are.

One :class:`Movables` serves all worlds of a process with the same robots and classes of objects. A :class:`Bodies`
holds where the bodies of one world are, ready to be drawn; only what has moved since the last look is worked out again.
"""

from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing
from functools import lru_cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import Catalog
from chmarl_pb.rendering import placing, raster
from chmarl_pb.rendering.camera import Picture, light
from chmarl_pb.rendering.canvas import canvas
from chmarl_pb.rendering.home_views import HomeView
from chmarl_pb.rendering.meshes import LinkMesh, link_meshes_of, models_of
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import UPRIGHT, Client, Pose, World, loaded_graspables, quiet
from chmarl_pb.world.bullet import pybullet

_KEPT = 8192  # poses of robots

#: Robot, its kind and the PyBullet joint indices of its movable joints; in the order of the world.
Team = tuple[tuple[str, RobotModel, tuple[int, ...]], ...]
Joints = tuple[float, ...]
Frames = NDArray[np.float64]  # (frames, 7) x, y, z in metres and quaternion x, y, z, w


def team_in(world: World, models: Mapping[str, RobotModel]) -> Team:
    """Return what is to be known of the robots of a world to draw them."""
    bodies = world.physics.robots
    return tuple((name, model, tuple(bodies[name].joints)) for name, model in models.items())


class Movables:
    """The models of all bodies that move.

    Attributes:
        numbers: name -> number of the body, in the order in which TinyRenderer draws them.
        models: their meshes.
        first_frame: name -> number of its first frame.
        frames: number of frames in all.
        scratch: room for drawing, see :func:`chmarl_pb.rendering.raster.draw`.
    """

    def __init__(self, robots: Team, known: Catalog) -> None:
        """Load all graspables of a catalogue and the robots once, to read their meshes."""
        with quiet(), closing(Client()) as client, loaded_graspables(client.number, known) as objects:
            things = link_meshes_of(client.number, [thing.body for thing in objects.values()])
        self._robots = _robots(robots)
        self._inertial = {name: thing.inertial for name, thing in objects.items()}
        parts = dict(zip(objects, things, strict=True)) | self._robots.parts
        self.numbers = {name: number for number, name in enumerate(parts)}
        self._links = {name: _links(own) for name, own in parts.items()}
        *starts, self.frames = np.cumsum([0, *map(len, self._links.values())]).tolist()
        self.first_frame = dict(zip(parts, starts, strict=True))
        self.models = models_of(
            list(parts.values()),
            [{link: start + place for place, link in enumerate(self._links[name])} for name, start in
             self.first_frame.items()],
        )  # fmt: skip
        self.scratch = np.empty((len(self.models.vertices), 6), np.float32)
        self._kept: dict[tuple[str, Pose, Joints], Frames] = {}
        self._balls: dict[tuple[str, Joints], tuple[float, float]] = {}

    def object_frames(self, name: str, pose: Pose) -> Frames:
        """Return where an object's frame is, from the pose of its origin."""
        centre, _ = pybullet.multiplyTransforms(*pose, self._inertial[name], UPRIGHT)
        return np.array([[*centre, *pose[1]]])

    def robot_frames(self, name: str, pose: Pose, joints: Joints) -> Frames:
        """Return where a robot's frames are.

        Args:
            name: of the robot.
            pose: of its base.
            joints: positions of its movable joints.
        """
        key = (name, pose, joints)
        frames = self._kept.get(key)
        if frames is None:
            if len(self._kept) >= _KEPT:
                del self._kept[next(iter(self._kept))]
            frames = self._kept[key] = self._ask(name, pose, joints)
        return frames

    def ball(self, name: str, joints: Joints) -> tuple[float, float]:
        """Return the height above its base and the radius of a ball that holds a robot however it is turned, metres."""
        if (name, joints) not in self._balls:
            if len(self._balls) >= _KEPT:
                self._balls.clear()
            bodies = Bodies(self)
            bodies.put_robot(name, ((0.0, 0.0, 0.0), UPRIGHT), joints)
            x, y, height, radius = bodies.stage.placed.balls[self.numbers[name]].tolist()
            self._balls[name, joints] = height, radius + float(np.hypot(x, y))
        return self._balls[name, joints]

    def _ask(self, name: str, pose: Pose, joints: Joints) -> Frames:
        """Let PyBullet work out a robot's frames."""
        return np.array([[*where[0], *where[1]] for where in self._robots.poses(name, self._links[name], pose, joints)])


class _Robots:
    """The robots of a team in a client of their own, which stays to tell where their links are.

    Attributes:
        parts: name -> what there is to see of each.
    """

    def __init__(self, team: Team) -> None:
        """Load them."""
        self._connection = Client()
        self._client = self._connection.number
        with quiet():
            self._bodies = {name: model.load(self._client) for name, model, _ in team}
        self.parts = dict(zip(self._bodies, link_meshes_of(self._client, [*self._bodies.values()]), strict=True))
        self._joints = {name: joints for name, _, joints in team}

    def poses(self, name: str, links: Iterable[int], pose: Pose, joints: Joints) -> Iterator[Pose]:
        """Yield the poses of a robot's links, at a pose of its base and positions of its movable joints."""
        body, client = self._bodies[name], self._client
        pybullet.resetBasePositionAndOrientation(body, *pose, physicsClientId=client)
        for index, value in zip(self._joints[name], joints, strict=True):
            pybullet.resetJointState(body, index, value, physicsClientId=client)
        for link in links:
            if link < 0:
                yield pose
            else:
                yield pybullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=client)[:2]


@lru_cache(maxsize=8)
def _robots(team: Team) -> _Robots:
    return _Robots(team)


def _links(parts: Iterable[LinkMesh]) -> list[int]:
    """Return the links that have parts, each once."""
    return list(dict.fromkeys(part.link for part in parts))


@lru_cache(maxsize=8)
def movables(robots: Team, known: Catalog) -> Movables:
    """Return the process's models of what moves where these robots and objects of these classes are."""
    return Movables(robots, known)


class Bodies:
    """Where the bodies of one world are.

    Attributes:
        stage: they and their places, ready to be drawn.
    """

    def __init__(self, models: Movables) -> None:
        """Begin with nothing in place."""
        self._movables = models
        self.stage = placing.Stage(models.models, models.frames, models.scratch)
        self._poses: dict[str, object] = {}

    def put_objects(self, poses: Mapping[str, Pose]) -> None:
        """Put objects at the poses of their origins."""
        moved = {name: pose for name, pose in poses.items() if self._poses.get(name) is not pose}
        if moved:
            self._poses |= moved
            frames = np.concatenate([self._movables.object_frames(name, pose) for name, pose in moved.items()])
            numbers = np.array([self._movables.numbers[name] for name in moved])
            first_frames = np.array([self._movables.first_frame[name] for name in moved])
            placing.put_each(numbers, first_frames, frames, self.stage.words)

    def put_robot(self, name: str, pose: Pose, joints: Joints) -> None:
        """Put a robot at the pose of its base, and its joints into their positions."""
        frames = self._movables.robot_frames(name, pose, joints)
        if self._poses.get(name) is not frames:
            self._poses[name] = frames
            number, first_frame = self._movables.numbers[name], self._movables.first_frame[name]
            placing.put(number, first_frame, frames, self.stage.words)


def draw_over(home: HomeView, bodies: Bodies, present: NDArray[np.int32], first: int) -> Picture:
    """Return a view of the empty home with bodies drawn into it.

    Args:
        home: the view.
        bodies: where the bodies are.
        present: numbers of those to draw.
        first: segmentation value of body 0; values of the home are kept as they are.
    """
    picture = home.picture
    size = len(picture.depth)
    depth, links, colour = picture.depth.copy(), picture.segmentation.astype(np.int32), picture.colour.copy()
    raster.picture(
        present, first, bodies.stage.words, home.sight.words, light(), canvas(size).words, True,
        colour.view(np.uint8).reshape(size, size, 4), depth, links,
    )  # fmt: skip
    return Picture(colour, depth, links)


def image_over(home: HomeView, bodies: Bodies, present: NDArray[np.int32]) -> NDArray[np.uint8]:
    """Return the colours (size, size, 3) of what :func:`draw_over` draws."""
    size = len(home.picture.depth)
    rgb: NDArray[Any] = cv2.cvtColor(home.picture.colour.view(np.uint8).reshape(size, size, 4), cv2.COLOR_RGBA2RGB)
    raster.paint(present, bodies.stage.words, home.sight.words, light(), canvas(size).words, rgb)
    return rgb
