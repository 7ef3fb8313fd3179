"""What a ball around a body tells: where in a picture the body can be seen, and whether the home hides it."""

from typing import Any

import numpy as np

from chmarl_pb.compiled import compiled
from chmarl_pb.packed import Packed, line, table
from chmarl_pb.rendering.triangles import Floats, Lens

TILE = 8  # pixels: side of the squares in which a body that the home hides is found out


class Sight:
    """A camera, and how far it sees at each pixel, before anything is drawn.

    Attributes:
        lens: the camera.
        depth: (size, size) in [0, 1].
        tiles: what :func:`farthest` makes of it.
        words: all of them as compiled functions take them.
    """

    def __init__(self, lens: Lens, depth: Floats, tiles: Floats | None = None):
        """Look at a depth; ``tiles`` need not be worked out again if they are known."""
        self.lens, self.depth = lens, depth
        self.tiles: Floats = farthest(depth) if tiles is None else tiles
        self._packed = Packed((*lens, depth, self.tiles), _SIGHT)
        self.words: Any = self._packed.words


_SIGHT = *[("f4", 2)] * 2, ("f8", 1), ("f4", 1), *[("f4", 2)] * 2


@compiled
def sight_of(words):  # type: ignore[no-untyped-def]
    """Return lens, depth and tiles of a packed :class:`Sight`."""
    lens = Lens(
        table(words, 0, np.float32), table(words, 1, np.float32), line(words, 2, np.float64), line(words, 3, np.float32)
    )
    return lens, table(words, 4, np.float32), table(words, 5, np.float32)


@compiled
def farthest(depth: Floats) -> Floats:
    """Return the greatest depth in each tile of ``TILE`` by ``TILE`` pixels of a picture."""
    size = depth.shape[0]
    count = (size + TILE - 1) // TILE
    tiles = np.zeros((count, count), np.float32)
    for i in range(size):
        for j in range(size):
            tiles[i // TILE, j // TILE] = max(tiles[i // TILE, j // TILE], depth[i, j])
    return tiles


@compiled
def _along(ball, matrix, axis):  # type: ignore[no-untyped-def]
    """Return a coordinate of a ball's centre in the camera's frame."""
    return matrix[axis, 0] * ball[0] + matrix[axis, 1] * ball[1] + matrix[axis, 2] * ball[2] + matrix[axis, 3]


@compiled
def _shadow(centre, radius, nearest, farthest, scale, size):  # type: ignore[no-untyped-def]
    """Return the least and the greatest coordinate in pixels that a ball can touch in the picture.

    Args:
        centre: of the ball, along that axis of the camera.
        radius: of the ball.
        nearest: distance of the plane before it.
        farthest: distance of the plane behind it.
        scale: pixels of a length of 1 at a distance of 1.
        size: of the picture.
    """
    low, high = centre - radius, centre + radius
    # What lies left of the axis is farthest to the left where it is nearest, else where it is farthest away.
    least = size / 2 + scale * low / (nearest if low < 0 else farthest) - 1
    return least, size / 2 + scale * high / (nearest if high > 0 else farthest) + 1


@compiled
def extent(ball, lens, tiles, size):  # type: ignore[no-untyped-def]
    """Return first and last column, first and last row that a ball can touch; 0, -1, 0, -1 if it cannot be seen."""
    radius, near, far = ball[3], np.float64(lens.planes[0]), np.float64(lens.planes[1])
    ahead = -_along(ball, lens.world_to_camera, 2)
    nearest, farthest = ahead - radius, ahead + radius
    if farthest <= near or nearest >= far:
        return 0, -1, 0, -1
    if nearest <= near:
        return 0, size - 1, 0, size - 1
    across = np.float64(lens.projection[0, 0]) * size / 2
    low_x, high_x = _shadow(_along(ball, lens.world_to_camera, 0), radius, nearest, farthest, across, size)
    if low_x > size - 1 or high_x < 0:
        return 0, -1, 0, -1
    upwards = np.float64(lens.projection[1, 1]) * size / 2
    low_y, high_y = _shadow(_along(ball, lens.world_to_camera, 1), radius, nearest, farthest, upwards, size)
    if low_y > size - 1 or high_y < 0:
        return 0, -1, 0, -1
    left, right = int(max(0.0, low_x)), int(min(size - 1.0, high_x))
    top, bottom = int(max(0.0, size - 1 - high_y)), int(min(size - 1.0, size - 1 - low_y))
    shortened = nearest * 0.999  # far more than rounding can matter
    depth = far * (shortened - near) / (shortened * (far - near))
    for i in range(top // TILE, bottom // TILE + 1):
        for j in range(left // TILE, right // TILE + 1):
            if tiles[i, j] >= depth:
                return left, right, top, bottom
    return 0, -1, 0, -1


@compiled
def may_show(ball, lens, tiles, size):  # type: ignore[no-untyped-def]
    """Return whether what is in a ball could be seen: it lies in view, and the home does not hide it.

    Args:
        ball: (4,) its x, y, z and radius, metres.
        lens: the camera.
        tiles: what :func:`farthest` makes of the empty home's depth.
        size: width and height of the picture.
    """
    left, right, _, _ = extent(ball, lens, tiles, size)
    return right >= left
