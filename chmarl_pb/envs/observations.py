"""Observation spaces and observations: a flat Dict of fixed-shape arrays for each robot."""

from functools import cache

import numpy as np
from gymnasium import spaces

from chmarl_pb import catalog
from chmarl_pb.envs.options import Options
from chmarl_pb.navigation.lattice import HEADINGS, heading_angle
from chmarl_pb.sensing.scene_graph import MAX_EDGES, MAX_NODES
from chmarl_pb.tasks import language
from chmarl_pb.tasks.messages import Messages
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.simulation import Stage
from chmarl_pb.world import WorldState

Observation = dict[str, np.ndarray]

_DIRECTIONS = [(float(np.cos(angle)), float(np.sin(angle))) for angle in map(heading_angle, range(HEADINGS))]


def observation_space(options: Options, rooms: tuple[str, ...]) -> spaces.Dict:
    """Return one robot's observation space; both robots have the same.

    ``self`` is (rooms + 4,): one-hot room (the last: none of them), cosine and sine of the heading,
    and 1 if the humanoid holds something. ``goal`` is (4,): class ids of X and Y, and 1 for each that is in view.
    """
    tokens = language.vocabulary_size() - 1
    parts: dict[str, spaces.Space] = {}
    if options.observation == "visual":
        parts["image"] = spaces.Box(0, 255, (options.image_size, options.image_size, 3), np.uint8)
    else:
        parts["node_class"] = spaces.Box(0, len(catalog.CLASSES), (MAX_NODES,), np.int16)
        parts["node_state"] = spaces.Box(0, len(catalog.STATES), (MAX_NODES,), np.int16)
        parts["edges"] = spaces.Box(0, MAX_NODES, (MAX_EDGES, 3), np.int16)
    parts["instruction"] = spaces.Box(0, tokens, (language.INSTRUCTION_LENGTH,), np.int16)
    parts["feedback"] = spaces.Box(0, tokens, (language.FEEDBACK_LENGTH,), np.int16)
    parts["messages"] = spaces.Box(0, 1, (2, len(rooms)), np.int8)
    parts["self"] = spaces.Box(-1, 1, (len(rooms) + 4,), np.float32)
    if options.goal:
        parts["goal"] = spaces.Box(0, np.array([len(catalog.CLASSES)] * 2 + [1] * 2, np.int16), dtype=np.int16)
    return spaces.Dict(parts)


def observe(
    options: Options,
    stage: Stage,
    robot: str,
    outcome: Outcome,
    setting: Setting,
    messages: Messages,
    instruction: np.ndarray,
    feedback: str,
    wanted: tuple[str, str] | None,
) -> Observation:
    """Return what one robot observes.

    Args:
        options: of the environment.
        stage: where the episode is played.
        robot: its name.
        outcome: of the last step.
        setting: of the episode.
        messages: what is known; observed as zeros if messages are off.
        instruction: token ids.
        feedback: what it was told about its last action.
        wanted: classes of X and Y as the instruction names them; None: they are not observed.
    """
    observation: Observation
    if options.observation == "visual":
        observation = {"image": stage.sight.colours(robot, options.image_size)}
    else:
        observation = stage.graphs.graph(outcome.state, outcome.seen[robot], setting.states).arrays()
    observation["instruction"] = instruction.copy()
    observation["feedback"] = language.tokenize(feedback, language.FEEDBACK_LENGTH)
    observation["messages"] = messages.copy() if options.messages else np.zeros_like(messages)
    observation["self"] = _self(stage, outcome.state, robot)
    if wanted is not None:
        in_view = {catalog.class_of(name) for name in outcome.seen[robot]}
        numbers = [*(catalog.CLASS_IDS[name] for name in wanted), *(name in in_view for name in wanted)]
        observation["goal"] = np.array(numbers, dtype=np.int16)
    return observation


def _self(stage: Stage, state: WorldState, robot: str) -> np.ndarray:
    body = state.robots[robot]
    return _self_vector(len(stage.rooms), stage.room_numbers[body.room], body.heading, robot in state.grips).copy()


@cache
def _self_vector(rooms: int, room: int, heading: int, holds: bool) -> np.ndarray:
    vector = np.zeros(rooms + 4, dtype=np.float32)
    vector[room] = 1
    vector[-3:] = *_DIRECTIONS[heading], holds
    return vector
