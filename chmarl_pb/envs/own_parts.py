"""Sensors, channels, advisers and kinds of tasks of the user's own, of which everything that they return is checked.

So a mistake is told where it is made, and what is observed is always in its space.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb.errors import OptionError
from chmarl_pb.fingerprint import name_of
from chmarl_pb.limits import whole_number
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.robots.goal import Goal
from chmarl_pb.sensing.sensors import Sensor, View
from chmarl_pb.tasks.advisers import Adviser, Goals
from chmarl_pb.tasks.kinds import TaskKind
from chmarl_pb.tasks.language import ATTRIBUTES_LENGTH, INSTRUCTION_LENGTH, words
from chmarl_pb.tasks.messages import Channel, Messages, Rooms
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.symbols import MOST_SYMBOLS, Talk
from chmarl_pb.tasks.tidy_task import AnyTask, is_task
from chmarl_pb.world import World, WorldState

if TYPE_CHECKING:
    from chmarl_pb.envs.options import Options

_LONGEST = 100  # characters of a value in a message
#: What infos have beside the texts of sensors.
_INFOS = frozenset((
    "instruction", "feedback", "action_success", "success", "is_success", "potential", "visible", "action_mask",
    "task_id",
))  # fmt: skip


class CheckedSensor:
    """A sensor whose keys and values are those of its spaces.

    Attributes:
        name: of its class.
    """

    def __init__(self, sensor: Sensor):
        """Check what this one returns."""
        self._sensor, self.name = sensor, name_of(sensor)
        self._spaces: dict[str, spaces.Box] = {}

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the sensor's spaces."""
        given = self._sensor.spaces()
        whole = isinstance(given, Mapping) and all(isinstance(key, str) for key in given)
        if not whole or not all(getattr(space, "shape", None) for space in given.values()):  # () of a Discrete
            wanted = "a dict of key -> space of arrays with a dimension or more, e.g. Box(0, 4, (1,), np.int64)"
            raise _wrong(f"{self.name}.spaces()", given, wanted)
        self._spaces = dict(given)
        return self._spaces

    def observe(self, view: View) -> dict[str, Any]:
        """Return what the sensor does."""
        given = self._sensor.observe(view)
        if not isinstance(given, Mapping) or given.keys() != self._spaces.keys():
            raise _wrong(f"{self.name}.observe()", given, f"a dict with the keys {sorted(self._spaces)}")
        return {key: self._checked(key, value) for key, value in given.items()}

    def _checked(self, key: str, value: Any) -> Any:
        space = self._spaces[key]
        if isinstance(value, str) and space.dtype == np.uint8 and len(space.shape) == 1:  # texts are bytes
            if key in _INFOS:
                raise _wrong(f"{self.name}.spaces()", key, "another key, as texts stand in infos, which have this one")
            return value
        return _in(space, value, f"{self.name}.observe()[{key!r}]")


class CheckedChannel:
    """A channel whose messages keep their shape, and are heard as its space says."""

    def __init__(self, channel: Channel):
        """Check what this one returns."""
        self._channel: Any = channel
        self._name = name_of(channel)
        self._kept: dict[int, tuple[tuple[int, ...], np.dtype[Any]]] = {}  # rooms -> shape and type of the messages

    def space(self, rooms: Rooms) -> spaces.Box:
        """Return the channel's space."""
        space: spaces.Box = self._channel.space(rooms)
        if getattr(space, "shape", None) is None:
            raise _wrong(f"{self._name}.space()", space, "a space of arrays, e.g. gymnasium.spaces.Box")
        self._space = space
        return space

    def begin(self, rooms: Rooms) -> Messages:
        """Return what has been said before an episode."""
        self.space(rooms)
        given = self._channel.begin(rooms)
        if not isinstance(given, np.ndarray) or given.dtype.kind not in "biuf":
            raise _wrong(f"{self._name}.begin()", given, "an array of numbers")
        self._now = self._kept.setdefault(len(rooms), (given.shape, given.dtype))
        return self._like("begin", given).copy()

    def update(
        self, messages: Messages, outcome: Outcome, goal: Goal, rooms: Rooms, rng: np.random.Generator
    ) -> Messages:
        """Return the messages with what robots have seen."""
        return self._like("update", self._channel.update(messages, outcome, goal, rooms, rng))

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return what a robot hears."""
        return _in(self._space, self._channel.hear(messages, robot, rng), f"{self._name}.hear()")

    def _like(self, method: str, given: Any) -> Messages:
        shape, dtype = self._now
        if not isinstance(given, np.ndarray) or (given.shape, given.dtype) != self._now:
            raise _wrong(f"{self._name}.{method}()", given, f"an array {shape} of {dtype}, as begin() has given")
        if not np.isfinite(given).all():
            raise _wrong(f"{self._name}.{method}()", given, "an array of finite numbers")
        return given


class CheckedTalk(CheckedChannel):
    """The same of a channel with own words."""

    def __init__(self, channel: Talk):
        """Check what this one returns."""
        super().__init__(channel)
        self.vocabulary = whole_number(f"{self._name}.vocabulary", channel.vocabulary, 2, MOST_SYMBOLS)

    def among(self, robots: tuple[str, ...]) -> "CheckedTalk":
        """Return the channel between these robots."""
        return CheckedTalk(self._channel.among(robots))

    def say(self, messages: Messages, said: Mapping[str, int], rng: np.random.Generator) -> Messages:
        """Return the messages with what robots have said."""
        return self._like("say", self._channel.say(messages, said, rng))

    def cost(self, said: Mapping[str, int]) -> float:
        """Return what it costs to say something."""
        given = self._channel.cost(said)
        if not _is_number(given):
            raise _wrong(f"{self._name}.cost()", given, "a finite number")
        return float(given)


class CheckedAdviser:
    """An adviser that says sentences to robots."""

    def __init__(self, adviser: Adviser):
        """Check what this one returns."""
        self._adviser = adviser

    def begin(self, simulation: Simulation, task: AnyTask, goals: Goals) -> None:
        """Watch an episode."""
        self._adviser.begin(simulation, task, goals)

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of actions."""
        self._adviser.before(actions, outcome)

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return robot -> sentence."""
        given: Any = self._adviser.after(succeeded, step)
        whole = isinstance(given, Mapping) and all(isinstance(said, str) for said in given.values())
        if not whole or not given.keys() <= succeeded.keys():
            raise _wrong(f"{name_of(self._adviser)}.after()", given, f"a dict of sentences to some of {[*succeeded]}")
        return dict(given)


class CheckedKind:
    """A kind of tasks whose methods return what they are to."""

    def __init__(self, kind: TaskKind, attributes: bool = False):
        """Check what this one returns.

        Args:
            kind: of the tasks.
            attributes: whether instructions may name colours and rooms, too.
        """
        self._kind, self._name = kind, name_of(kind)
        self.objects = whole_number(f"{self._name}.objects", kind.objects, 1)
        self._most = INSTRUCTION_LENGTH * self.objects + ATTRIBUTES_LENGTH * attributes

    def tasks(self, split: str) -> list[AnyTask]:
        """Return the fixed tasks of a split."""
        given: Any = self._kind.tasks(split)
        if not isinstance(given, list | tuple) or not all(map(is_task, given)):
            wanted = "a list of chmarl_pb.Task, no classes derived of it, which may be empty"
            raise _wrong(f"{self._name}.tasks()", given, wanted)
        return [*given]

    def sample(self, space: Space, home: str, rng: np.random.Generator, task_id: str | None = None) -> AnyTask:
        """Draw a task for a home."""
        given = self._kind.sample(space, home, rng, task_id)
        if not is_task(given) or given.home != home:
            raise _wrong(f"{self._name}.sample()", given, f"a chmarl_pb.Task, no class derived of it, in {home}")
        return given

    def set_up(self, world: World, space: Space, task: AnyTask) -> Setting:
        """Lay a task out."""
        given = self._kind.set_up(world, space, task)
        self._require("set_up", given, Setting, "a Setting, see Rearrange.set_up")
        if not given.goals:
            raise _wrong(f"{self._name}.set_up()", given, "a Setting with one goal or more")
        return given

    def outcome(self, state: WorldState, setting: Setting, seen: dict[str, tuple[str, ...]]) -> Outcome:
        """Return the facts of a state."""
        given = self._kind.outcome(state, setting, seen)
        self._require("outcome", given, Outcome, "an Outcome, see chmarl_pb.tasks.outcome.outcome_of")
        goals, parts = len(setting.goals), given.parts
        whole = isinstance(parts, tuple) and all(isinstance(part, Outcome) for part in parts)
        enough = whole and (len(parts) == goals or (goals == 1 and not parts))
        for name, right, wanted in (
            ("potential", _is_number(given.potential), "a finite number"),
            ("success", isinstance(given.success, bool | np.bool_), "True or False"),
            ("seen", given.seen == seen, "what it is given as seen"),
            ("parts", enough, f"an Outcome for each goal of the setting, of which there are {goals}"),
        ):
            if not right:
                raise _wrong(f"{self._name}.outcome().{name}", getattr(given, name), wanted)
        return replace(given, potential=float(given.potential), success=bool(given.success))

    def instruction(self, task: AnyTask) -> str:
        """Return what a task asks for."""
        given = self._kind.instruction(task)
        self._require("instruction", given, str, "a sentence")
        if len(words(given)) > self._most:
            raise _wrong(f"{self._name}.instruction()", given, f"at most {self._most} words, of which robots read all")
        return given

    def _require(self, method: str, given: object, kind: Any, wanted: str) -> None:
        if not isinstance(given, kind):
            raise _wrong(f"{self._name}.{method}()", given, wanted)


def checked_kind(kind: TaskKind, options: "Options") -> TaskKind:
    """Return a kind of tasks, checked if it is the user's own."""
    return CheckedKind(kind, options.lookalikes) if "task" in options.own() else kind


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and bool(np.isfinite(value))


def _in(space: spaces.Space[Any], value: Any, what: str) -> NDArray[Any]:
    """Return an array, or a number of NumPy's, in the type of its space, if nothing of it is lost thereby."""
    if isinstance(value, np.ndarray | np.generic) and np.can_cast(value.dtype, space.dtype or value.dtype):
        held = np.array(value, space.dtype)  # a copy, as the next one may be written into the same array
        if space.contains(held):
            return held
    raise _wrong(what, value, f"a value of its space, {space}")


def _wrong(what: str, given: Any, wanted: str) -> OptionError:
    """Return an error: what was given in the place of what is wanted."""
    shown = repr(given)
    if isinstance(given, np.ndarray) and given.size:
        shown = f"an array {given.shape} of {given.dtype}, from {given.min()} to {given.max()}"
    elif len(shown) > _LONGEST:
        shown = f"{shown[:_LONGEST]}..."
    return OptionError(f"{what} is {shown}; it is to be {wanted}")
