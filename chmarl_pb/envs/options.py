"""The keyword arguments that all environments share, checked once."""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb.envs.limits import MAX_STEPS as MAX_STEPS
from chmarl_pb.errors import OptionError
from chmarl_pb.tasks.feedback import STYLES
from chmarl_pb.tasks.splits import SPLIT_HOMES, SPLITS

OBSERVATIONS = ("scene_graph", "visual")
EXECUTIONS = ("instant", "simulated")
RENDER_MODES = (None, "rgb_array", "human")

# Options in every result; others are recorded where they are not the default, so that older results read the same.
_RECORDED = ("observation", "split", "messages", "feedback", "max_steps", "image_size")
_UNRECORDED = ("home", "render_mode")


@dataclass(frozen=True)
class Options:
    """What an environment can be asked for.

    Attributes:
        observation: "scene_graph" or "visual".
        split: split of the benchmark that tasks are drawn from.
        home: name or path of a home to play in instead of the split's homes.
        messages: whether the robots' messages are observed; if not, they read as zeros.
        feedback: style of the language feedback: "paper" (or True), "planner"; it is empty if False.
        max_steps: joint steps after which an episode is truncated.
        image_size: width and height of camera images in pixels.
        execution: "instant" or "simulated".
        render_mode: None, "rgb_array" or "human".
        goal: whether what the instruction asks for is observed as class ids, with what of it is in view.
    """

    observation: str = "scene_graph"
    split: str = "train"
    home: str | Path | None = None
    messages: bool = True
    feedback: bool | str = True
    max_steps: int = MAX_STEPS
    image_size: int = 128
    execution: str = "instant"
    render_mode: str | None = None
    goal: bool = False

    def __post_init__(self) -> None:
        """Check every value.

        Raises:
            OptionError: an option has a value that it does not know.
        """
        _one_of("observation", self.observation, OBSERVATIONS)
        _one_of("split", self.split, SPLITS)
        _one_of("execution", self.execution, EXECUTIONS)
        _one_of("render_mode", self.render_mode, RENDER_MODES)
        _one_of("messages", self.messages, (True, False))
        _one_of("feedback", self.feedback, (True, False, *STYLES))
        _one_of("goal", self.goal, (True, False))
        _whole("max_steps", self.max_steps, 1, 1_000_000)
        _whole("image_size", self.image_size, 16, 1024)

    @property
    def feedback_style(self) -> str | None:
        """The style of feedback, or None if there is none."""
        if isinstance(self.feedback, str):
            return self.feedback
        return STYLES[0] if self.feedback else None

    def recorded(self) -> dict[str, Any]:
        """Return what results say of the options: always of the first ones, of others where they are not the default."""
        values = {field.name: getattr(self, field.name) for field in fields(self) if field.name not in _UNRECORDED}
        defaults = {field.name: field.default for field in fields(self)}
        return {name: value for name, value in values.items() if name in _RECORDED or value != defaults[name]}

    @property
    def homes(self) -> tuple[str, ...]:
        """The homes that episodes are played in."""
        return SPLIT_HOMES[self.split] if self.home is None else (str(self.home),)


def checked_seed(seed: int) -> int:
    """Return a seed that random generators take.

    Raises:
        OptionError: it is not a whole number from 0 on.
    """
    if not isinstance(seed, int | np.integer) or isinstance(seed, bool) or seed < 0:
        raise OptionError(f"seed={seed!r} is not a whole number from 0 on")
    return int(seed)


def _one_of(name: str, value: object, known: tuple[object, ...]) -> None:
    if value not in known:
        raise OptionError(f"{name}={value!r} is not known; use one of: {', '.join(repr(item) for item in known)}")


def _whole(name: str, value: object, low: int, high: int) -> None:
    if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
        raise OptionError(f"{name}={value!r} is not a whole number from {low} to {high}")
