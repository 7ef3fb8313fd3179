"""Observation spaces and observations: a flat Dict of fixed-shape arrays for each robot."""

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, COLOURS, Catalog
from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError
from chmarl_pb.navigation.lattice import DIRECTIONS
from chmarl_pb.sensing.sensors import View
from chmarl_pb.sensing.text import as_bytes
from chmarl_pb.tasks import language
from chmarl_pb.tasks.lookalike_task import LookalikeTask
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.world import WorldState

Observation = dict[str, np.ndarray]


class Wanted(NamedTuple):
    """What an instruction asks for, as the option ``goal`` lets it be observed.

    Attributes:
        classes: ids of the classes of X and Y.
        things: names of what would do as X, and as Y.
        attributes: id of the colour of X, and number of the room of Y from 1 on; 0 where the instruction names none.
    """

    classes: tuple[int, int]
    things: tuple[frozenset[str], frozenset[str]]
    attributes: tuple[int, int]


class Observer:
    """Makes the observations of an environment's robots.

    Attributes:
        space: of one robot's observation; all robots have the same.
    """

    def __init__(self, options: Options, rooms: tuple[str, ...], known: Catalog = BENCHMARK):
        """Observe with the sensors of an environment.

        ``self`` is (rooms + 4,): one-hot room (the last: none of them), cosine and sine of the heading,
        and 1 if the humanoid holds something. ``goal`` is (4,): class ids of X and Y, and 1 for each that is in view.
        Among lookalikes ``goal_attributes`` (2,) goes with it: id of X's colour, and number of Y's room in ``rooms``
        from 1 on, 0 where the instruction names none.

        Raises:
            OptionError: two sensors have a key in common, or one has a key of the environment itself.
        """
        self._sensors, self._catalog = options.sensors_of(known), known
        parts: dict[str, spaces.Space[Any]] = {}
        for sensor in self._sensors:
            _add(parts, sensor.spaces(), getattr(sensor, "name", type(sensor).__name__))
        tokens = language.vocabulary_size(known, options.lookalikes) - 1
        self._rooms, self._among = rooms, options.lookalikes
        self._words = language.INSTRUCTION_LENGTH * options.kind.objects
        self._feedback_words = language.FEEDBACK_LENGTH
        if self._among:
            self._words, self._feedback_words = (
                length + language.ATTRIBUTES_LENGTH for length in (self._words, self._feedback_words)
            )
        own: dict[str, spaces.Space[Any]] = {
            "instruction": spaces.Box(0, tokens, (self._words,), np.int16),
            "feedback": spaces.Box(0, tokens, (self._feedback_words,), np.int16),
            "messages": options.channel.space(rooms),
            "self": spaces.Box(-1, 1, (len(rooms) + 4,), np.float32),
        }
        if options.goal:
            own["goal"] = spaces.Box(0, np.array([len(known.rows)] * 2 + [1] * 2, np.int16), dtype=np.int16)
            if self._among:
                most = np.array([len(COLOURS), len(rooms)], np.int16)
                own["goal_attributes"] = spaces.Box(0, most, dtype=np.int16)
        _add(parts, own, "the environment")
        self.space = spaces.Dict(parts)
        self._parts = parts

    def tokens(self, instruction: str) -> np.ndarray:
        """Return an instruction as token ids."""
        return language.tokenize(instruction, self._words, self._catalog, self._among)

    def wanted(self, instruction: str, setting: Setting) -> Wanted:
        """Return what an instruction asks for."""
        try:
            item, target = language.parse_instruction(instruction, self._catalog)
        except ValueError as error:  # of a kind of tasks of the user's own
            raise OptionError(f"goal=True: nothing tells what is asked for, as the instruction {error}") from error
        goal, task, ids = setting.goal, setting.task, self._catalog.class_ids
        attributes = (0, 0)
        if isinstance(task, LookalikeTask):
            room = self._rooms.index(task.room) + 1 if task.room in self._rooms else 0
            attributes = catalog.COLOUR_IDS[task.colour], room
        things = frozenset((goal.item,)), frozenset(goal.receptacles)
        return Wanted((ids[item], ids[target]), things, attributes)

    def observe(
        self, simulation: Simulation, view: View, instruction: np.ndarray, wanted: Wanted | None
    ) -> tuple[Observation, dict[str, str]]:
        """Return what one robot observes, and the texts among it as they are.

        Args:
            simulation: where the episode is played.
            view: what its sensors may read.
            instruction: token ids.
            wanted: what the instruction asks for; None: it is not observed.
        """
        observation: Observation = {}
        texts: dict[str, str] = {}
        for sensor in self._sensors:
            for key, value in sensor.observe(view).items():
                if isinstance(value, str):
                    texts[key] = value
                    value = as_bytes(value, self._parts[key].shape[0])  # type: ignore[index]
                observation[key] = value
        observation["instruction"] = instruction.copy()
        observation["feedback"] = language.tokenize(view.feedback, self._feedback_words, self._catalog, self._among)
        observation["messages"] = view.messages
        observation["self"] = _self(simulation, view.state, view.robot)
        if wanted is not None:
            in_view = (not things.isdisjoint(view.seen) for things in wanted.things)
            observation["goal"] = np.array([*wanted.classes, *in_view], dtype=np.int16)
            if self._among:
                observation["goal_attributes"] = np.array(wanted.attributes, dtype=np.int16)
        return observation, texts


def _add(parts: dict[str, spaces.Space[Any]], more: Mapping[str, spaces.Space[Any]], whose: str) -> None:
    if common := sorted(parts.keys() & more.keys()):
        raise OptionError(f"observation: {whose} has the keys {common}, which another sensor has too; rename them")
    parts.update(more)


def _self(simulation: Simulation, state: WorldState, robot: str) -> np.ndarray:
    body = state.robots[robot]
    return _self_vector(
        len(simulation.rooms), simulation.room_numbers[body.room], body.heading, robot in state.grips
    ).copy()


@cache
def _self_vector(rooms: int, room: int, heading: int, holds: bool) -> np.ndarray:
    vector = np.zeros(rooms + 4, dtype=np.float32)
    vector[room] = 1
    vector[-3:] = *DIRECTIONS[heading], holds
    return vector
