"""Draws moments between lattice poses: the cameras follow the bodies through a driven motion.

A scene holds the poses of all that moves. At the end of a step its picture equals
:meth:`chmarl_pb.rendering.renderer.Renderer.picture`, pixel by pixel.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.lattice import DRONE_HEADING
from chmarl_pb.rendering.camera import view_matrix
from chmarl_pb.rendering.camera_poses import CAMERAS, DRONE_EYE, HUMANOID_EYE, PITCH, looking
from chmarl_pb.rendering.home_views import HomeView, home_views
from chmarl_pb.rendering.movables import Bodies, draw_over, movables
from chmarl_pb.robots.arm import Arm, Configuration
from chmarl_pb.robots.execution import Snapshot
from chmarl_pb.world import Pose, Vector, World


@dataclass(frozen=True)
class Scene:
    """Where everything is that moves, at one moment.

    Attributes:
        robots: robot -> pose of its base.
        arm: configuration of the humanoid's arm.
        objects: object present -> its pose.
    """

    robots: dict[str, Pose]
    arm: Configuration
    objects: dict[str, Pose]

    def eye(self, robot: str) -> Pose:
        """Return the pose of link "camera" of a robot; its +x looks along the line of sight."""
        (x, y, z), quaternion = self.robots[robot]
        if robot == "drone":
            return (x, y, z + DRONE_EYE), looking(DRONE_HEADING, np.pi / 2)
        heading = yaw(quaternion)
        forward, _, height = HUMANOID_EYE
        lift = self.arm[0]
        position = (x + forward * float(np.cos(heading)), y + forward * float(np.sin(heading)), height + lift)
        return position, looking(heading, PITCH)


def scene_of(world: World) -> Scene:
    """Return the present scene of a world."""
    robots = {name: robot.base for name, robot in world.robots.items()}
    objects = {name: world.pose(name) for name in world.objects}
    return Scene(robots, Arm.carry if world.held else Arm.rest, objects)


def scene_during(snapshot: Snapshot, after: Scene) -> Scene:
    """Return the scene of a snapshot; things that it does not name are where they are after the motion."""
    return Scene(snapshot.bases, snapshot.arm, after.objects | snapshot.items)


class Replay:
    """Draws scenes of one home; what has not moved since the last picture is not drawn again."""

    def __init__(self, home: Home):
        """Share the process's models of the home and of what moves."""
        self._views = home_views(home)
        self._bodies = Bodies()
        self._homes: dict[tuple[str, int], HomeView] = {}
        self._pictures: dict[tuple[str, int], tuple[object, NDArray[np.uint8]]] = {}

    def picture(self, robot: str, scene: Scene, size: int) -> NDArray[np.uint8]:
        """Return what a robot's camera shows of a scene, (size, size, 3).

        Args:
            robot: "humanoid" or "drone".
            scene: the moment.
            size: width and height in pixels.
        """
        view = view_matrix(scene.eye(robot))
        shown = (view, scene.objects, scene.robots, scene.arm)
        kept = self._pictures.get((robot, size))
        if kept is None or kept[0] != shown:
            self._bodies.put_objects(scene.objects)
            for name, pose in scene.robots.items():
                self._bodies.put_robot(name, pose, scene.arm)
            names = sorted([*scene.objects, *scene.robots], key=movables().numbers.__getitem__)
            present = np.array([movables().numbers[name] for name in names], dtype=np.int32)
            picture = draw_over(self._look(robot, view, size), self._bodies, present, 0)
            self._pictures[robot, size] = kept = shown, picture.rgb
        return kept[1]

    def _look(self, robot: str, view: Vector, size: int) -> HomeView:
        """Return the empty home."""
        kept = self._homes.get((robot, size))
        if kept is None or kept.view != view:
            self._homes[robot, size] = kept = self._views.draw(CAMERAS[robot], view, size)
        return kept


def yaw(quaternion: Vector) -> float:
    """Return the angle about z in radians of an upright orientation (x, y, z, w)."""
    return float(2 * np.arctan2(quaternion[2], quaternion[3]))
