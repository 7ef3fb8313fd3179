"""The home in 3D, in viser's scene: its things, the robots and objects that move, view cones and labels."""

from collections.abc import Callable, Mapping

import numpy as np
import viser
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from chmarl_pb.frames.canvas import ROBOTS
from chmarl_pb.frames.motion_player import Scene
from chmarl_pb.frames.recording import Recording
from chmarl_pb.homes.export import gltf_of
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.rooms import Thing
from chmarl_pb.homes.solids import Points
from chmarl_pb.rendering.movables import movables
from chmarl_pb.viewer.live.gltf import frames_of

Image = NDArray[np.uint8]

_CONE = 1.0  # metres, about
#: From the axes of viser's cameras (right, down, forward) to ours (forward, left, up).
_OPTICAL = Rotation.from_quat((-0.5, 0.5, -0.5, 0.5))


class House:
    """What viser's scene holds of one recording."""

    def __init__(self, server: viser.ViserServer, recording: Recording, clicked: Callable[[str], None]):
        """Put everything into the scene, as it is at the start.

        Args:
            server: whose scene it is; what was there goes.
            recording: of what.
            clicked: is told the name of a thing, an object or a robot that is clicked.
        """
        self._server, self._recording, self._clicked = server, recording, clicked
        self._movables = movables(recording.team, recording.home.catalog)
        scene = server.scene
        scene.reset()
        scene.set_up_direction("+z")
        _look_at(server, recording.home)
        self._add_home(recording.home)
        start = recording.moments[0].rest
        self._frames = {name: self._add_body(name) for name in (*start.robots, *start.objects)}
        self._cones = {
            name: scene.add_camera_frustum(
                f"/cones/{name}", np.radians(model.camera.fov), 1.0, scale=_CONE, color=ROBOTS[place % len(ROBOTS)],
                cast_shadow=False,
            )
            for place, (name, model) in enumerate(recording.models.items())
        }  # fmt: skip
        self._labels: dict[str, viser.LabelHandle] = {}
        self._middles = {thing.name: _top(thing) for thing in recording.home.things}
        self._shown: dict[str, object] = {}
        self.show(start)

    def show(self, scene: Scene) -> None:
        """Move everything to where it is in a scene."""
        with self._server.atomic():
            for name, pose in scene.robots.items():
                if self._moves(name, (pose, scene.joints[name])):
                    self._place(name, self._movables.robot_frames(name, pose, scene.joints[name]))
                    self._point(name, scene)
            for name, pose in scene.objects.items():
                if self._moves(name, pose):
                    self._place(name, self._movables.object_frames(name, pose))

    def show_pictures(self, pictures: Mapping[str, Image]) -> None:
        """Put the robots' pictures into their cones."""
        for name, picture in pictures.items():
            self._cones[name].image = picture

    def show_cones(self, visible: bool) -> None:
        """Show or hide the robots' view cones."""
        for cone in self._cones.values():
            cone.visible = visible

    def label(self, texts: Mapping[str, str], scene: Scene) -> None:
        """Write texts at things, objects and robots; earlier ones go.

        Args:
            texts: name -> text.
            scene: where what moves is.
        """
        for name in self._labels.keys() - texts.keys():
            self._labels.pop(name).remove()
        moving = {name: np.asarray(pose[0]) for name, pose in (scene.objects | scene.robots).items()}
        places = self._middles | moving
        for name, text in texts.items():
            if name not in self._labels:
                self._labels[name] = self._server.scene.add_label(f"/labels/{name}", text, anchor="bottom-center")
            self._labels[name].text = text
            self._labels[name].position = places[name]

    def _add_home(self, home: Home) -> None:
        """Add floors and walls as one, and each other thing as one that can be clicked."""
        whole, structure = np.eye(4), {thing.name for thing in home.structure}
        links = [link for link in home.links if link.visuals or link.collisions]
        shell = gltf_of([link for link in links if link.name in structure], whole)
        self._server.scene.add_glb("/home", shell, cast_shadow=False)
        for link in links:
            if link.name not in structure:
                self._add(f"/home/{link.name}", link.name, gltf_of([link], whole))

    def _add_body(self, name: str) -> list[viser.GlbHandle]:
        parts = frames_of(self._movables, name)
        return [self._add(f"/moving/{name}/{number}", name, part) for number, part in enumerate(parts)]

    def _add(self, path: str, name: str, data: bytes) -> viser.GlbHandle:
        handle = self._server.scene.add_glb(path, data, cast_shadow=False)
        handle.on_click(lambda _: self._clicked(name))
        return handle

    def _moves(self, name: str, place: object) -> bool:
        moved = self._shown.get(name) != place
        self._shown[name] = place
        return moved

    def _place(self, name: str, frames: NDArray[np.float64]) -> None:
        for handle, frame in zip(self._frames[name], frames, strict=True):
            handle.position, handle.wxyz = frame[:3], frame[[6, 3, 4, 5]]

    def _point(self, name: str, scene: Scene) -> None:
        """Turn a robot's view cone to where its camera looks."""
        position, quaternion = scene.eye(name, self._recording.models[name])
        self._cones[name].position = np.asarray(position)
        self._cones[name].wxyz = (Rotation.from_quat(quaternion) * _OPTICAL).as_quat()[[3, 0, 1, 2]]


def _look_at(server: viser.ViserServer, home: Home) -> None:
    """Let new pages begin with a look at a whole home."""
    low, high = (np.asarray(corner)[:2] for corner in home.bounds)
    middle, reach = (low + high) / 2, float(np.max(high - low))
    server.initial_camera.look_at = (*middle.tolist(), 0.0)
    server.initial_camera.position = (middle[0], middle[1] - 0.55 * reach, 0.95 * reach)


def _top(thing: Thing) -> Points:
    """Return where the label of a thing stands."""
    highest = max((solid.top for solid in thing.solids), default=thing.frame[2, 3])
    return np.append(thing.centre, highest)
