"""The renderers by name."""

from collections.abc import Callable, Mapping

from chmarl_pb.rendering.fast import FastRenderer
from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.rendering.tiny import TinyRenderer
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import World

#: Name -> what makes the renderer of a world, whose robots are all in it, and of their models.
RENDERERS: dict[str, Callable[[World, Mapping[str, RobotModel]], Renderer]] = {
    "fast": FastRenderer,
    "tiny": TinyRenderer,
}
