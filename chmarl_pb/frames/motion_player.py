"""Draws moments between lattice poses: the cameras follow the bodies through a driven motion.

A scene holds the poses of all that moves. At the end of a step its picture equals
:meth:`chmarl_pb.rendering.renderer.Renderer.picture`, pixel by pixel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.lattice import DRONE_HEADING
from chmarl_pb.rendering.camera import Picture, camera_of, view_matrix
from chmarl_pb.rendering.home_views import HomeView, home_views
from chmarl_pb.rendering.movables import Bodies, Joints, Team, draw_over, movables
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, can_be_visible
from chmarl_pb.rendering.visible_pixels import count_pixels
from chmarl_pb.robots.execution import Snapshot
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import Pose, Vector, World


@dataclass(frozen=True)
class Scene:
    """Where everything is that moves, at one moment.

    Attributes:
        robots: robot -> pose of its base.
        joints: robot -> positions of its movable joints.
        objects: object present -> its pose.
    """

    robots: dict[str, Pose]
    joints: dict[str, Joints]
    objects: dict[str, Pose]

    def eye(self, robot: str, model: RobotModel) -> Pose:
        """Return the pose of the camera of a robot of a kind; its +x looks along the line of sight."""
        base = self.robots[robot]
        heading = DRONE_HEADING if model.flies else yaw(base[1])
        return model.camera.eye(base, heading, self.joints[robot][0] if model.lifts_camera else 0.0)


def scene_of(world: World) -> Scene:
    """Return the present scene of a world."""
    robots = {name: robot.base for name, robot in world.robots.items()}
    joints = {name: robot.joints for name, robot in world.robots.items()}
    return Scene(robots, joints, {name: world.pose(name) for name in world.objects})


def scene_during(snapshot: Snapshot, after: Scene) -> Scene:
    """Return the scene of a snapshot; things that it does not name are where they are after the motion."""
    return Scene(snapshot.bases, snapshot.joints, after.objects | snapshot.items)


class Replay:
    """Draws scenes of one home; what has not moved since the last picture is not drawn again."""

    def __init__(self, home: Home, team: Team):
        """Share the process's models of the home and of what moves."""
        self._home, self._views, self._movables = home, home_views(home), movables(team, home.catalog)
        self._models = {name: model for name, model, _ in team}
        self._bodies = Bodies(self._movables)
        self._homes: dict[tuple[str, int], HomeView] = {}
        self._pictures: dict[tuple[str, int], tuple[object, NDArray[np.uint8]]] = {}

    def picture(self, robot: str, scene: Scene, size: int) -> NDArray[np.uint8]:
        """Return what a robot's camera shows of a scene, (size, size, 3).

        Args:
            robot: its name.
            scene: the moment.
            size: width and height in pixels.
        """
        view = view_matrix(scene.eye(robot, self._models[robot]))
        shown = (view, scene.objects, scene.robots, scene.joints)
        kept = self._pictures.get((robot, size))
        if kept is None or kept[0] != shown:
            self._pictures[robot, size] = kept = shown, self._draw(robot, view, scene, size).rgb
        return kept[1]

    def pixels(self, robot: str, scene: Scene) -> dict[str, int]:
        """Return thing -> its pixels in the picture that decides what a robot sees, for all that have any.

        Args:
            robot: its name.
            scene: the moment.
        """
        view = view_matrix(scene.eye(robot, self._models[robot]))
        names = (*(link.name for link in self._home.links), *self._movables.numbers)
        counts = count_pixels(self._draw(robot, view, scene, VISIBILITY_SIZE).segmentation, len(names))
        known = can_be_visible(names, self._models, robot, self._home.catalog)
        return {names[number]: int(counts[number]) for number in np.flatnonzero(known & (counts > 0))}

    def _draw(self, robot: str, view: Vector, scene: Scene, size: int) -> Picture:
        """Draw a scene; the segmentation counts the home's links, then all that moves."""
        self._bodies.put_objects(scene.objects)
        for name, pose in scene.robots.items():
            self._bodies.put_robot(name, pose, scene.joints[name])
        numbers = self._movables.numbers
        present = np.array(sorted(numbers[name] for name in (*scene.objects, *scene.robots)), dtype=np.int32)
        return draw_over(self._look(robot, view, size), self._bodies, present, len(self._home.links))

    def _look(self, robot: str, view: Vector, size: int) -> HomeView:
        """Return the empty home."""
        kept = self._homes.get((robot, size))
        if kept is None or kept.view != view:
            self._homes[robot, size] = kept = self._views.draw(camera_of(self._models[robot]), view, size)
        return kept


def yaw(quaternion: Vector) -> float:
    """Return the angle about z in radians of an upright orientation (x, y, z, w)."""
    return float(2 * np.arctan2(quaternion[2], quaternion[3]))
