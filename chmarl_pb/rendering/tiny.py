"""The plain renderer: PyBullet's TinyRenderer draws the whole world anew for every picture. Slow, but easy to read."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.rendering.camera import Picture, camera_of, render, view_matrix
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS, can_be_visible, renderer_names
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.world import World


class TinyRenderer:
    """Draws what the robots of one world see; see :class:`chmarl_pb.rendering.renderer.Renderer`."""

    def __init__(self, world: World, robots: Mapping[str, RobotModel]):
        """Draw in the world's own client."""
        self._world, self._space, self._robots = world, space_of(world.home), robots
        self.names = renderer_names(world)

    def picture(self, robot: str, size: int) -> Picture:
        """Return what a robot's camera shows."""
        self._world.sync()
        client, model = self._world.client, self._robots[robot]
        view = view_matrix(model.eye(self._space, self._world.robots[robot].pose))
        drawn = render(client, camera_of(model), view, size)
        # TinyRenderer makes normals unit vectors at every use, in place, which rounds some of them to and fro: odd
        # pictures of a client are equal, and this one of a single pixel makes the next one odd again.
        render(client, camera_of(model), view, 1)
        return Picture(drawn.colour, drawn.depth, self._named(drawn.segmentation))

    def image(self, robot: str, size: int) -> NDArray[np.uint8]:
        """Return the colours of what a robot's camera shows."""
        return self.picture(robot, size).rgb

    def visible(self, robot: str) -> tuple[str, ...]:
        """Return the names of the things that a robot sees."""
        segmentation = self.picture(robot, VISIBILITY_SIZE).segmentation
        pixels = np.bincount(segmentation.ravel() + 1, minlength=len(self.names) + 1)[1:]
        counts = can_be_visible(self.names, self._robots, robot, self._world.home.catalog)
        return tuple(self.names[number] for number in np.flatnonzero(counts & (pixels >= VISIBLE_PIXELS)))

    def could_see(self, robot: str, item: str) -> bool:
        """Return True: what is seen is found out by drawing all."""
        return True

    def _named(self, segmentation: NDArray[np.integer]) -> NDArray[np.int32]:
        """Return a segmentation in indices of ``names``, from PyBullet's ``body + (link + 1) << 24``."""
        body, link = segmentation & 0xFFFFFF, (segmentation >> 24) - 1
        named = np.where(segmentation < 0, -1, link).astype(np.int32)
        numbers = {name: number for number, name in enumerate(self.names)}
        for name, number in self._world.bodies.items():
            if name != "home":
                named[(segmentation >= 0) & (body == number)] = numbers[name]
        return named
