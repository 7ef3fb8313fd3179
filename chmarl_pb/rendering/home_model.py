"""Draws the empty home: all its things at rest, with the rasteriser that draws what moves."""

from functools import lru_cache

import numpy as np

from chmarl_pb.errors import AssetError
from chmarl_pb.rendering import placing, raster
from chmarl_pb.rendering.bounds import Sight, farthest
from chmarl_pb.rendering.camera import Picture, light
from chmarl_pb.rendering.canvas import canvas
from chmarl_pb.rendering.meshes import LinkMesh, link_meshes_of, models_of
from chmarl_pb.rendering.triangles import Floats, Lens, depth_of
from chmarl_pb.world.bullet import pybullet

_WHITE = 255


class HomeModel:
    """A body whose links do not move, ready to be drawn from anywhere."""

    def __init__(self, client: int, body: int):
        """Read the body's meshes.

        Raises:
            AssetError: TinyRenderer has to draw it: a visual shape is no box and no plain mesh, or PyBullet does not
                tell where a link is, as from the 128th on.
        """
        links = range(-1, pybullet.getNumJoints(body, physicsClientId=client))
        (parts,) = link_meshes_of(client, [body])
        things: list[list[LinkMesh]] = [[] for _ in links]
        for part in parts:
            things[part.link + 1].append(part)
        models = models_of(things, [{link: number} for number, link in enumerate(links)])
        self._stage = placing.Stage(models, len(things))
        shown = np.array([number for number, thing in enumerate(things) if thing], dtype=np.int64)
        poses = [_pose(client, body, number - 1) for number in shown.tolist()]
        rows = np.array([[*position, *orientation] for position, orientation in poses]).reshape(-1, 7)
        placing.put_each(shown, shown, rows, self._stage.words)
        self._shown = shown.astype(np.int32)

    def draw(self, lens: Lens, size: int, colours: bool = True) -> Picture:
        """Return the picture that a camera takes; its segmentation holds link indices, -1 for nothing.

        Args:
            lens: the camera at its pose.
            size: width and height in pixels.
            colours: whether it has any, which takes twice the time.
        """
        side = size if colours else 0
        colour = np.full((side, side, 4), _WHITE, np.uint8)
        sight = Sight(lens, *_nothing(size, *lens.planes.tolist()))
        depth, links = sight.depth.copy(), np.full((size, size), -1, np.int32)
        raster.picture(
            self._shown, -1, self._stage.words, sight.words, light(), canvas(size).words, colours, colour, depth, links
        )
        return Picture(colour.view(np.uint32)[..., 0], depth, links.astype(np.int16))


@lru_cache(maxsize=16)
def _nothing(size: int, near: float, far: float) -> tuple[Floats, Floats]:
    """Return the depth of a picture of nothing, between a camera's planes, and its tiles."""
    depth = np.full((size, size), depth_of(-np.float32(far), np.float32(near), np.float32(far)), np.float32)
    return depth, farthest(depth)


def _pose(client: int, body: int, link: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return where a link's inertial frame is."""
    if link < 0:
        position, orientation = pybullet.getBasePositionAndOrientation(body, physicsClientId=client)
        return position, orientation
    try:
        state = pybullet.getLinkState(body, link, computeForwardKinematics=True, physicsClientId=client)
    except pybullet.error as error:
        raise AssetError(f"link {link}: {error}") from error
    return state[0], state[1]
