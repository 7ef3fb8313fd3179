"""Sensors: each gives some keys of a robot's observation; the built-in ones by name, others as objects."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.rendering.camera import Camera, camera_of
from chmarl_pb.rendering.renderer import Renderer, classes_of
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.sensing.scene_graph import MAX_EDGES, MAX_NODES, SceneGraph, SceneGraphs
from chmarl_pb.world import WorldState


class View(NamedTuple):
    """One robot's side of one moment: all that a sensor may read. Sensors change nothing.

    Attributes:
        robot: its name.
        models: robot -> its kind, of all robots.
        actions: names of its actions, in the order of their numbers.
        state: of the world; it is the truth, so a fair sensor reads no more of it than the robot's own part.
        room: name of the room that it is in.
        renderer: draws what the robots' cameras show.
        graphs: scene graphs of what robots see.
        seen: names of the things in this robot's view.
        states: name of a thing -> its symbolic state.
        rooms: rooms that have a message bit, in order.
        instruction: in plain English.
        feedback: on its last action; empty if there is none.
        messages: what it hears, as the channel gives it.
        succeeded: whether its last action could be done; True after a reset.
        rng: the environment's random numbers, for sensors with noise.
        board: whether ``messages`` are the message board, in which rooms X and Y have been seen.
    """

    robot: str
    models: Mapping[str, RobotModel]
    actions: tuple[str, ...]
    state: WorldState
    room: str
    renderer: Renderer
    graphs: SceneGraphs
    seen: tuple[str, ...]
    states: Mapping[str, str]
    rooms: tuple[str, ...]
    instruction: str
    feedback: str
    messages: NDArray[Any]
    succeeded: bool
    rng: np.random.Generator
    board: bool = True

    def graph(self) -> SceneGraph:
        """Return the scene graph of what the robot sees."""
        return self.graphs.graph(self.state, self.seen, self.states)

    def image(self, size: int) -> NDArray[np.uint8]:
        """Return what the robot's camera shows, (size, size, 3)."""
        return self.renderer.image(self.robot, size)

    def depth(self, size: int) -> NDArray[np.float32]:
        """Return the distance along the line of sight of what each pixel shows, (size, size), metres."""
        buffer = self.renderer.picture(self.robot, size).depth
        return camera_of(self.models[self.robot]).distance(buffer)

    def classes(self, size: int) -> NDArray[np.int16]:
        """Return the class id of what each pixel shows, (size, size); 0 is anything without a class, as walls."""
        picture = self.renderer.picture(self.robot, size)
        ids = [self.graphs.catalog.class_ids.get(name, 0) for name in classes_of(self.renderer.names, self.models)]
        ids.append(0)  # for -1, which is nothing
        classes: NDArray[np.int16] = np.array(ids, dtype=np.int16)[picture.segmentation]
        return classes


@runtime_checkable
class Sensor(Protocol):
    """Gives some keys of every robot's observation, e.g. ``observation=("scene_graph", MySensor())``.

    An object that is given must be picklable, as environments are copied with it, and keep nothing of an episode.

    >>> class InView:
    ...     def spaces(self):
    ...         return {"in_view": spaces.Box(0, 999, (1,), np.int16)}
    ...
    ...     def observe(self, view):
    ...         return {"in_view": np.array([len(view.seen)], np.int16)}
    >>> env = chmarl_pb.parallel_env(observation=InView(), split="val-unseen")
    >>> observations, infos = env.reset(seed=0)
    >>> observations["humanoid"]["in_view"] == [len(infos["humanoid"]["visible"])]
    array([ True])
    """

    def spaces(self) -> dict[str, spaces.Box]:
        """Return key -> space of its values; texts take :func:`text_space`."""

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return key -> value; a text is observed as bytes, and given in infos as it is."""


def text_space(length: int) -> spaces.Box:
    """Return the space of texts as so many bytes of UTF-8, filled up with zeros; longer ones are cut."""
    return spaces.Box(0, 255, (length,), np.uint8)


class SceneGraphSensor:
    """The scene graph of what the robot sees: ``node_class``, ``node_state``, ``edges``."""

    def __init__(self, known: Catalog = BENCHMARK):
        """Observe ids of a catalogue."""
        self._known = known

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the spaces of the three arrays."""
        return {
            "node_class": spaces.Box(0, len(self._known.rows), (MAX_NODES,), np.int16),
            "node_state": spaces.Box(0, len(self._known.states), (MAX_NODES,), np.int16),
            "edges": spaces.Box(0, MAX_NODES, (MAX_EDGES, 3), np.int16),
        }

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the three arrays."""
        return {**view.graph().arrays()}


@dataclass(frozen=True)
class _CameraSensor:
    """What a robot's camera shows, as pictures of this width and height in pixels; class ids are a catalogue's."""

    size: int
    known: Catalog = field(default=BENCHMARK, repr=False)


class ImageSensor(_CameraSensor):
    """The camera's colours: ``image``."""

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of pictures."""
        return {"image": spaces.Box(0, 255, (self.size, self.size, 3), np.uint8)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the picture."""
        return {"image": view.image(self.size)}


class DepthSensor(_CameraSensor):
    """How far away everything is that the camera shows: ``depth``, metres along the line of sight."""

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of pictures; the camera's far plane is its end."""
        return {"depth": spaces.Box(0, Camera.far, (self.size, self.size), np.float32)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the picture."""
        return {"depth": view.depth(self.size)}


class SegmentationSensor(_CameraSensor):
    """What each pixel shows: ``segmentation``, class ids as in ``node_class``, 0 where nothing has a class."""

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of pictures."""
        return {"segmentation": spaces.Box(0, len(self.known.rows), (self.size, self.size), np.int16)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the picture."""
        return {"segmentation": view.classes(self.size)}


#: Name -> what makes the sensor, for a size in pixels and a catalogue; :mod:`chmarl_pb.sensing.text` adds "text".
CAMERA_SENSORS: dict[str, Callable[[int, Catalog], Sensor]] = {
    "visual": ImageSensor,
    "depth": DepthSensor,
    "segmentation": SegmentationSensor,
}
