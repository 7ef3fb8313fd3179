"""The renderers by name."""

from collections.abc import Callable

from chmarl_pb.rendering.fast import FastRenderer
from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.rendering.tiny import TinyRenderer
from chmarl_pb.world import World

#: Name -> what makes the renderer of a world whose robots are all in it.
RENDERERS: dict[str, Callable[[World], Renderer]] = {"fast": FastRenderer, "tiny": TinyRenderer}
