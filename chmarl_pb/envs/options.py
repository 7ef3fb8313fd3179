"""The keyword arguments that all environments share, checked once."""

import os
from copy import deepcopy
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.envs.own_parts import CheckedAdviser, CheckedChannel, CheckedSensor, CheckedTalk
from chmarl_pb.envs.tracks import OF_TRACK, PAPER, TRACKS
from chmarl_pb.errors import OptionError
from chmarl_pb.fingerprint import name_of
from chmarl_pb.limits import whole_number
from chmarl_pb.rendering.registry import RENDERERS
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.sensing.cells import NodeViewSensor
from chmarl_pb.sensing.colours import NodeColourSensor
from chmarl_pb.sensing.sensors import CAMERA_SENSORS, SceneGraphSensor, Sensor
from chmarl_pb.sensing.text import TextSensor
from chmarl_pb.tasks.advisers import CRITICS, STYLES, Adviser, SpokenAdviser
from chmarl_pb.tasks.kinds import KINDS, TaskKind
from chmarl_pb.tasks.language.own_names import load_things
from chmarl_pb.tasks.language.templates import REVISIONS
from chmarl_pb.tasks.messages import Board, Channel, Silence
from chmarl_pb.tasks.splits import SPLITS, homes_of
from chmarl_pb.tasks.symbols import Symbols, Talk
from chmarl_pb.tasks.unreliable import UnreliableAdviser

OBSERVATIONS = ("scene_graph", "visual")  # the benchmark's; sensors are more
SENSORS = ("scene_graph", *CAMERA_SENSORS, "text")
EXECUTIONS = ("instant", "simulated")
SYMBOLS = "symbols"  # the option ``messages`` for own words with the usual dials
RENDER_MODES = (None, "rgb_array", "human")

Observed = str | Sensor | tuple[str | Sensor, ...]  # what the option ``observation`` may be

# Options in every result; others are recorded where they are not the default, so that older results read the same.
_RECORDED = ("observation", "split", "messages", "feedback", "max_steps", "image_size")
_UNRECORDED = ("home", "render_mode")


@dataclass(frozen=True)
class Options:
    """What an environment can be asked for.

    Objects (sensors, a channel, an adviser) must be picklable: copies of an environment are made anew from its options.

    Attributes:
        observation: "scene_graph", "visual", "depth", "segmentation" or "text", a :class:`Sensor`, or a tuple of them;
            names may also be joined, as "scene_graph+depth".
        split: split that tasks are drawn from; "generated" draws homes, too, a new one every 100 episodes.
        task: kind of the tasks: "rearrange", the benchmark's; "tidy"; or a :class:`TaskKind`.
        home: name or path of a home to play in instead of the split's homes.
        messages: whether the robots' messages are observed; if not, they read as zeros. "symbols": own words, see
            :class:`chmarl_pb.tasks.symbols.Symbols`. Or a :class:`Channel`.
        feedback: style of the language feedback: "paper" (or True), "planner"; it is empty if False. Or an
            :class:`Adviser`.
        max_steps: joint steps after which an episode is truncated.
        image_size: width and height of camera images in pixels.
        execution: "instant" or "simulated".
        render_mode: None, "rgb_array" or "human".
        renderer: "fast", or "tiny" for plain TinyRenderer: the same pictures, far slower.
        pointing: whether Pick and Place name a cell of the robot's picture and act on what is there, see
            :mod:`chmarl_pb.tasks.pointing`; scene graphs then tell where nodes are in it.
        lookalikes: whether one to three other objects of X's class in other colours stand in the home, so that the
            instruction names the colour of X, and the room of Y where that class is not unique; see
            :mod:`chmarl_pb.tasks.lookalike_task`. Scene graphs then tell the colours of objects.
        goal: whether what the instruction asks for is observed as class ids, with what of it is in view.
        robots: one to eight robots in the order in which they act: names of the package's, paths of robot files, or
            :class:`RobotModel` objects.
        catalog: catalogue file (TOML) of own objects and furniture; None: the one that
            ``CHMARL_CATALOG`` names, if any.
        templates: revision of the sentences of instructions and feedback: 1, the benchmark's, or 2, the same tasks in
            mended sentences.
        track: "paper" or "grounded"; options that are not given have its values, see :mod:`chmarl_pb.envs.tracks`.
    """

    observation: Observed = "scene_graph"
    split: str = OF_TRACK
    home: str | Path | None = None
    messages: bool | str | Channel = OF_TRACK
    feedback: bool | str | Adviser = OF_TRACK
    max_steps: int = OF_TRACK
    image_size: int = 128
    execution: str = "instant"
    render_mode: str | None = None
    goal: bool = False
    task: str | TaskKind = "rearrange"
    renderer: str = "fast"
    robots: tuple[str | Path | RobotModel, ...] = TEAM
    catalog: str | Path | None = None
    pointing: bool = OF_TRACK
    lookalikes: bool = OF_TRACK
    templates: int = OF_TRACK
    track: str = PAPER

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            OptionError: an option has a value that it does not know.
        """
        for field in fields(self):
            object.__setattr__(self, field.name, plain_value(getattr(self, field.name)))
        check_one_of("track", self.track, tuple(TRACKS))
        for name, value in TRACKS[self.track].items():
            if getattr(self, name) is OF_TRACK:
                object.__setattr__(self, name, value)
        for part in self._observed():
            check_one_of("observation", part, SENSORS, Sensor)
        if self.catalog is None:  # fixed here: copies in other processes are to know the same things
            object.__setattr__(self, "catalog", os.environ.get("CHMARL_CATALOG") or None)
        if not isinstance(self.catalog, str | os.PathLike | None):
            raise OptionError(f"catalog={self.catalog!r} is no path; name a catalogue file (.toml)")
        check_one_of("split", self.split, SPLITS)
        check_one_of("execution", self.execution, EXECUTIONS)
        check_one_of("render_mode", self.render_mode, RENDER_MODES)
        check_one_of("renderer", self.renderer, tuple(RENDERERS))
        check_one_of("messages", self.messages, (True, False, SYMBOLS), Channel)
        check_one_of("feedback", self.feedback, (True, False, *STYLES), Adviser)
        if isinstance(self.feedback, str) and self.feedback == STYLES[0]:
            object.__setattr__(self, "feedback", True)  # the same rule, recorded alike
        check_one_of("goal", self.goal, (True, False))
        check_one_of("pointing", self.pointing, (True, False))
        check_one_of("lookalikes", self.lookalikes, (True, False))
        check_one_of("templates", self.templates, REVISIONS)
        check_one_of("task", self.task, tuple(KINDS), TaskKind)
        team_of(self.robots)
        object.__setattr__(self, "robots", tuple(self.robots))  # a list of the same is the same option
        if self.goal and self.kind.objects != 1:
            raise OptionError("goal=True needs tasks that name one object; use task='rearrange'")
        if self.lookalikes and self.kind.objects != 1:
            raise OptionError("lookalikes=True needs tasks that name one object; use task='rearrange'")
        whole_number("max_steps", self.max_steps, 1, 1_000_000)
        whole_number("image_size", self.image_size, 16, 1024)

    def _observed(self) -> tuple[Any, ...]:
        """Return the names and sensors that ``observation`` means."""
        given = self.observation if isinstance(self.observation, tuple | list) else (self.observation,)
        if not given:
            raise OptionError(f"observation={self.observation!r} names no sensor; use one of: {', '.join(SENSORS)}")
        return tuple(name for part in given for name in (part.split("+") if isinstance(part, str) else (part,)))

    def sensors_of(self, known: Catalog) -> tuple[Sensor, ...]:
        """Return what every robot observes the classes of a catalogue with, in order."""
        parts = self._observed()
        own = [self._sensor(part, known) if isinstance(part, str) else CheckedSensor(part) for part in parts]
        return (*own, *self._beside_graphs) if "scene_graph" in parts else tuple(own)

    def graph_sensors(self, known: Catalog) -> tuple[Sensor, ...]:
        """Return what a robot would observe scene graphs with, whether it does or not."""
        return (SceneGraphSensor(known), *self._beside_graphs)

    @property
    def _beside_graphs(self) -> tuple[Sensor, ...]:
        return (*[NodeViewSensor()] * self.pointing, *[NodeColourSensor()] * self.lookalikes)

    def _sensor(self, name: str, known: Catalog) -> Sensor:
        if name in CAMERA_SENSORS:
            return CAMERA_SENSORS[name](self.image_size, known)
        if name == "text":
            return TextSensor(self.lookalikes, not isinstance(self.messages, str | Symbols | Talk))
        return SceneGraphSensor(known)

    @property
    def shows_graphs(self) -> bool:
        """Whether observations hold scene graphs."""
        return any(part == "scene_graph" or isinstance(part, SceneGraphSensor) for part in self._observed())

    @property
    def things(self) -> Catalog:
        """The classes of things.

        Raises:
            AssetError: the catalogue file cannot be used, or sentences cannot name its things.
        """
        return BENCHMARK if self.catalog is None else load_things(self.catalog, self.lookalikes)

    @property
    def channel(self) -> Channel:
        """What carries messages.

        Raises:
            OptionError: robots are to have own words, and there is but one.
        """
        channel = Symbols() if self.messages == SYMBOLS else self.messages
        if isinstance(channel, Talk):
            talk = CheckedTalk(channel) if "messages" in self.own() else channel
            return talk.among(tuple(self.models))
        if isinstance(channel, Channel):
            return CheckedChannel(channel) if "messages" in self.own() else channel
        return Board() if channel else Silence()

    @property
    def adviser(self) -> Adviser | None:
        """A new adviser, or None if there is no feedback."""
        if isinstance(self.feedback, Adviser):
            try:
                adviser = deepcopy(self.feedback)
            except TypeError as error:
                raise OptionError(
                    f"feedback={self.feedback!r} cannot be copied, as each environment does: {error}"
                ) from error
            if isinstance(adviser, UnreliableAdviser):
                adviser.templates = self.templates
            return CheckedAdviser(adviser) if "feedback" in self.own() else adviser
        if not self.feedback:
            return None
        critic = CRITICS[self.feedback if isinstance(self.feedback, str) else STYLES[0]]
        return SpokenAdviser(critic, self.templates)

    @property
    def kind(self) -> TaskKind:
        """The kind of the tasks."""
        return KINDS[self.task] if isinstance(self.task, str) else self.task

    @property
    def models(self) -> dict[str, RobotModel]:
        """Agent -> what is known of its kind of robot."""
        return team_of(self.robots)

    @property
    def homes(self) -> tuple[str, ...]:
        """The homes that episodes are played in."""
        return homes_of(self.split) if self.home is None else (str(self.home),)

    def recorded(self) -> dict[str, Any]:
        """Return what results say of the options, as plain data: seldom used ones only if they are not the paper's.

        Of another track all that it has a value for is recorded.
        """
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in _UNRECORDED}
        defaults = {field.name: field.default for field in fields(self)} | TRACKS[PAPER]
        always = _RECORDED if self.track == PAPER else (*_RECORDED, *TRACKS[self.track])
        kept = {name: value for name, value in values.items() if name in always or value != defaults[name]}
        return {name: _plain(value) for name, value in kept.items()} | {"observation": self.observation_name}

    def own(self) -> dict[str, Any]:
        """Return option -> the user's own objects in it, of which :meth:`recorded` does not tell all."""
        values = {field.name: getattr(self, field.name) for field in fields(self)} | {"observation": self._observed()}
        parts = {name: value if isinstance(value, tuple) else (value,) for name, value in values.items()}
        found = {name: [part for part in of_option if _is_own(part)] for name, of_option in parts.items()}
        return {name: objects for name, objects in found.items() if objects}

    @property
    def observation_name(self) -> str:
        """The name of what is observed, with a "+" between several."""
        return "+".join(_plain(part) for part in self._observed())


def _plain(value: Any) -> Any:
    """Return a value of an option as plain data: objects by the name of their class, with the fields of a dataclass."""
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, RobotModel):
        return value.name
    if isinstance(value, Path):
        return str(value)
    if value is None or isinstance(value, str | bool | int):
        return value
    return f"{type(value).__module__}:{value!r}" if is_dataclass(value) else name_of(value)


def _is_own(value: Any) -> bool:
    """Return whether a value of an option is an object that is not told by its name, path, or fields."""
    told = value is None or isinstance(value, str | bool | int | Path | RobotModel)
    return not told and not (is_dataclass(value) and type(value).__module__.startswith("chmarl_pb."))


def plain_value(value: Any) -> Any:
    """Return a value of NumPy's that is a truth, a whole number or a text as Python's own, and others as they are."""
    return value.item() if isinstance(value, np.bool_ | np.integer | np.str_) else value


def check_one_of(name: str, value: object, known: tuple[object, ...], protocol: type | None = None) -> None:
    """Check an option's value, which is to be of the same type as what it equals: neither 1 nor 1.0 is True.

    Args:
        name: of the option.
        value: what it was given.
        known: values that it knows: texts, numbers, truths or None.
        protocol: what objects may be given beside them.

    Raises:
        OptionError: it is none of these.
    """
    if protocol is not None and not isinstance(value, str | bool | type) and isinstance(value, protocol):
        return
    alike = [item for item in known if type(item) is type(value) or isinstance(value, str)]
    if value not in alike:
        objects = f", or an object that is a {protocol.__name__}" if protocol else ""
        values = ", ".join(repr(item) for item in known)
        raise OptionError(f"{name}={value!r} is not known; use one of: {values}{objects}")
