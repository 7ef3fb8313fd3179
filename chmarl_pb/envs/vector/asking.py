"""Questions to all environments of a vector: their methods, attributes and pictures."""

from typing import Any

from chmarl_pb.envs.vector.engine import AnyEngine
from chmarl_pb.errors import OptionError


class Asking:
    """A vector that asks its environments, and closes them.

    Attributes:
        num_envs: number of environments.
    """

    num_envs: int
    _engine: AnyEngine

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
