"""Which places for an object touch objects that stand already: boxes that stand upright, turned about z."""

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.navigation.free_space import Size
from chmarl_pb.world.bodies import Pose

_GAP = 0.01  # metres kept free between two objects

#: Bottom centre x, y, z, extents along its own axes (metres) and yaw (radians) of an object that stands.
Box: TypeAlias = tuple[float, float, float, float, float, float, float]


def box_of(pose: Pose, size: Size) -> Box:
    """Return an object's box from the pose of its bottom centre and its extents along its own axes, metres."""
    (x, y, z), quaternion = pose
    return x, y, z, *size, 2 * math.atan2(quaternion[2], quaternion[3])


def touching(places: NDArray[np.floating], size: Size, boxes: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return at which places an object would touch one of the boxes.

    Args:
        places: (n, 4) x, y, z (metres) and yaw (radians) of its bottom centre.
        size: extents along its own axes, metres.
        boxes: (m, 7) what :func:`box_of` returns of other objects.
    """
    places = np.ascontiguousarray(places, dtype=np.float64)
    touches, near = np.zeros(len(places), np.bool_), np.empty(len(boxes), np.int64)
    near = near[: _find_near(places, size, boxes, near)]
    if len(near):
        yaw_of, yaws = np.empty(len(places), np.int64), np.empty(len(places))
        yaws = yaws[: _find_yaws(places, yaw_of, yaws)]
        # Sines and cosines are NumPy's, as those of compiled code may differ in the last bit.
        turns = boxes[near, 6][:, None] - yaws
        turned = np.abs(np.cos(turns)), np.abs(np.sin(turns))
        _find_touching(places, size, boxes[near], yaw_of, np.cos(yaws), np.sin(yaws), *turned, touches)
    return touches


@compiled
def _reach(size, box):  # type: ignore[no-untyped-def]
    """Return the distance along x or y from which on two objects never touch, however they are turned."""
    return (size[0] + size[1] + box[3] + box[4]) / 2 + 2 * _GAP


@compiled
def _find_near(places, size, boxes, near):  # type: ignore[no-untyped-def]
    """Set the first of ``near`` to the numbers of the boxes that may touch something, and return how many they are."""
    low, high = np.full(3, np.inf), np.full(3, -np.inf)
    for place in range(len(places)):
        for axis in range(3):
            low[axis], high[axis] = min(low[axis], places[place, axis]), max(high[axis], places[place, axis])
    count = 0
    for number in range(len(boxes)):
        box, reach = boxes[number], _reach(size, boxes[number])
        beside = low[0] - reach < box[0] < high[0] + reach and low[1] - reach < box[1] < high[1] + reach
        if beside and low[2] <= box[2] + box[5] and box[2] <= high[2] + size[2]:
            near[count] = number
            count += 1
    return count


@compiled
def _find_yaws(places, yaw_of, yaws):  # type: ignore[no-untyped-def]
    """Set the first of ``yaws`` to the distinct yaws of places, ``yaw_of`` (n,) to their numbers; return how many."""
    count = 0
    for place in range(len(places)):
        number = 0
        while number < count and yaws[number] != places[place, 3]:
            number += 1
        if number == count:
            yaws[count] = places[place, 3]
            count += 1
        yaw_of[place] = number
    return count


@compiled
def _find_touching(places, size, boxes, yaw_of, cosines, sines, turn_cosines, turn_sines, touches):  # type: ignore[no-untyped-def]
    """Set ``touches`` (n,) to True where an object would touch a box.

    Args:
        places: (n, 4) as :func:`touching` has them.
        size: extents of the object, metres.
        boxes: (m, 7) the boxes.
        yaw_of: (n,) number of the yaw of each place.
        cosines: (k,) of the yaws.
        sines: (k,) of the yaws.
        turn_cosines: (m, k) absolute cosines of the turns from the yaws to the boxes'.
        turn_sines: (m, k) their absolute sines.
        touches: set to True where a place touches a box.
    """
    for number in range(len(boxes)):
        box, reach = boxes[number], _reach(size, boxes[number])
        for place in range(len(places)):
            dx, dy, z = box[0] - places[place, 0], box[1] - places[place, 1], places[place, 2]
            level = z <= box[2] + box[5] and z + size[2] >= box[2]
            if not level or abs(dx) >= reach or abs(dy) >= reach:
                continue
            yaw = yaw_of[place]
            cosine, sine, c, s = cosines[yaw], sines[yaw], turn_cosines[number, yaw], turn_sines[number, yaw]
            along = abs(cosine * dx + sine * dy) > size[0] / 2 + (c * box[3] + s * box[4]) / 2 + _GAP
            across = abs(cosine * dy - sine * dx) > size[1] / 2 + (s * box[3] + c * box[4]) / 2 + _GAP
            if not (along or across):
                touches[place] = True
