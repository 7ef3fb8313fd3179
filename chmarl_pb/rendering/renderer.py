"""The seam behind which pictures are made: who draws what robots see, and what counts as visible.

Whoever wants to know what a robot sees asks a :class:`Renderer` and needs to read no further. The readable one is
:mod:`chmarl_pb.rendering.tiny`; :mod:`chmarl_pb.rendering.fast` gives the same, bit by bit,
about a hundred times as fast.
"""

from collections.abc import Iterable, Mapping
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import Catalog
from chmarl_pb.rendering.camera import Picture
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import World

VISIBILITY_SIZE = 128  # pixels: width and height of the pictures that decide what is visible
VISIBLE_PIXELS = 4  # of its own that a visible thing has in such a picture, whatever picture the policy gets


class Renderer(Protocol):
    """Draws what the robots of one world see, in its present state.

    >>> env = chmarl_pb.parallel_env("visual", split="val-unseen", renderer="tiny", image_size=64)
    >>> observations, infos = env.reset(seed=0)
    >>> renderer = env.simulation.renderer
    >>> np.array_equal(renderer.image("drone", 64), observations["drone"]["image"])
    True
    >>> renderer.visible("drone") == tuple(infos["drone"]["visible"])
    True

    Attributes:
        names: every name that can be visible: the home's links, then objects, then robots.
    """

    names: tuple[str, ...]

    def picture(self, robot: str, size: int) -> Picture:
        """Return colours, depth and segmentation of what a robot's camera shows.

        Args:
            robot: its name.
            size: width and height in pixels.

        Returns:
            The picture; its segmentation holds indices of ``names``, -1 for nothing.
        """

    def image(self, robot: str, size: int) -> NDArray[np.uint8]:
        """Return the colours (size, size, 3) of the same picture."""

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees, in the order of ``names``.

        Visible is what has a class of the catalogue and at least ``VISIBLE_PIXELS`` pixels in the robot's picture of
        ``VISIBILITY_SIZE``; a robot does not see itself.
        """

    def could_see(self, robot: str, item: str) -> bool:
        """Return False if a robot would not see an object even if nothing hid it; True says nothing."""


def renderer_names(world: World) -> tuple[str, ...]:
    """Return every name that can be visible in a world, in the order of :attr:`Renderer.names`."""
    return (*world.links, *world.physics.objects, *world.physics.robots)


def classes_of(names: Iterable[str], robots: Mapping[str, RobotModel]) -> list[str]:
    """Return the class of each name that can be visible: of a robot the one that its model names."""
    return [robots[name].class_name if name in robots else catalog.class_of(name) for name in names]


def can_be_visible(
    names: tuple[str, ...], robots: Mapping[str, RobotModel], robot: str, known: Catalog
) -> NDArray[np.bool_]:
    """Return which of some names count if a robot's picture shows them: those of known classes, but its own."""
    has_class = [name in known.classes for name in classes_of(names, robots)]
    return np.array([name != robot and counts for name, counts in zip(names, has_class, strict=True)])
