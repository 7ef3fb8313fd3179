"""What all vectors have in common: what they tell of themselves, and questions to all of their environments."""

from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

from chmarl_pb.envs.vector.engine import AnyEngine
from chmarl_pb.envs.vector.infos import InfoTable
from chmarl_pb.errors import OptionError


class Asking:
    """A vector that tells what it is like, asks its environments, and closes them.

    Attributes:
        num_envs: number of environments.
    """

    num_envs: int
    _engine: AnyEngine

    def _describe(self, engine: AnyEngine, count: int, answered: int, autoreset: AutoresetMode) -> None:
        """Tell what the vector is like.

        Args:
            engine: where its environments live.
            count: their number.
            answered: how many of them are answered at once.
            autoreset: when one whose episode is over is reset.
        """
        self._engine, self.num_envs, one = engine, count, engine.signature
        self.metadata = {**one.metadata, "autoreset_mode": autoreset}
        self.render_mode = one.render_mode
        self.single_observation_space, self.single_action_space = one.observation_space, one.action_space
        self.observation_space = batch_space(one.observation_space, answered)
        self.action_space = batch_space(one.action_space, answered)
        self._table = InfoTable(count)

    def _as_observed(self, arrays: dict[str, np.ndarray]) -> Any:
        """Return arrays as environments observe them: by their keys, or the one array itself."""
        return arrays if isinstance(self.single_observation_space, gymnasium.spaces.Dict) else arrays[""]

    def render(self) -> tuple[Any, ...]:
        """Return the pictures of all environments."""
        return self.call("render")

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """Call a method of each environment, or read an attribute."""
        return self._ask("call", name, args, kwargs)

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Read an attribute of each environment."""
        return self._ask("get", name)

    def set_attr(self, name: str, values: Any) -> None:
        """Set an attribute of each environment: a list or tuple has a value for each, anything else is for all."""
        each = values if isinstance(values, list | tuple) else [values] * self.num_envs
        if len(each) != self.num_envs:
            raise OptionError(f"set_attr({name!r}) got {len(each)} values for {self.num_envs} environments")
        self._ask("set", name, each)

    def close_extras(self, **kwargs: Any) -> None:
        """Close the environments and end the workers."""
        self._engine.close()

    def _ask(self, command: str, *arguments: Any) -> tuple[Any, ...]:
        self._engine.send(command, range(self.num_envs), *arguments)
        return tuple(self._engine.receive())
