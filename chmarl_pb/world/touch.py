"""Which places for an object touch objects that stand already: boxes that stand upright, turned about z."""

import math
from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.navigation.free_space import Size
from chmarl_pb.world.bodies import Pose

_GAP = 0.01  # metres kept free between two objects


def touching(places: NDArray[np.floating], size: Size, others: Iterable[tuple[Pose, Size]]) -> NDArray[np.bool_]:
    """Return at which places an object would touch one of the others.

    Args:
        places: (n, 4) x, y, z (metres) and yaw (radians) of its bottom centre.
        size: extents along its own axes, metres.
        others: poses of the others, each of its bottom centre, and their extents, metres.
    """
    touches = np.zeros(len(places), dtype=bool)
    if not len(places):
        return touches
    x0, y0, z0, _ = np.minimum.reduce(places).tolist()
    x1, y1, z1, _ = np.maximum.reduce(places).tolist()
    for pose, other in others:
        x, y, z = pose[0]
        # Farther apart than this along x or y, two objects never touch, however they are turned.
        reach = (size[0] + size[1] + other[0] + other[1]) / 2 + 2 * _GAP
        near = x0 - reach < x < x1 + reach and y0 - reach < y < y1 + reach
        if near and z0 <= z + other[2] and z <= z1 + size[2]:
            touches[_touching_one(places, size, reach, pose, other)] = True
    return touches


def _touching_one(places: NDArray[np.floating], size: Size, reach: float, pose: Pose, other: Size) -> NDArray[np.int_]:
    """Return the numbers of the places where an object would touch one other; all of them are within reach."""
    (x, y, z), quaternion = pose
    dx, dy = x - places[:, 0], y - places[:, 1]
    level = (places[:, 2] <= z + other[2]) & (places[:, 2] + size[2] >= z)
    (rows,) = (level & (np.abs(dx) < reach) & (np.abs(dy) < reach)).nonzero()
    dx, dy, yaw = dx[rows], dy[rows], places[rows, 3]
    cosine, sine = np.cos(yaw), np.sin(yaw)
    turn = 2 * math.atan2(quaternion[2], quaternion[3]) - yaw
    c, s = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    along = np.abs(cosine * dx + sine * dy) > size[0] / 2 + (c * other[0] + s * other[1]) / 2 + _GAP
    across = np.abs(cosine * dy - sine * dx) > size[1] / 2 + (s * other[0] + c * other[1]) / 2 + _GAP
    touching: NDArray[np.int_] = rows[~(along | across)]
    return touching
