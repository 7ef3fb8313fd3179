"""Which places touch boxes: the compiled answer is that of the rectangles themselves."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from chmarl_pb.world import yaw_quaternion
from chmarl_pb.world.touch import _GAP, box_of, touching

lengths = st.floats(0.02, 0.5)
sizes = st.tuples(lengths, lengths, lengths)
places = st.tuples(st.floats(-1, 1), st.floats(-1, 1), st.sampled_from((0.4, 0.5, 1.0)), st.floats(-3, 3))
Size = tuple[float, float, float]
Place = tuple[float, float, float, float]


def overlap(place: Place, size: Size, other: Place, other_size: Size) -> float:
    """How far (metres) two boxes are from being apart along some axis of theirs; they touch from 0 on."""
    if place[2] > other[2] + other_size[2] or place[2] + size[2] < other[2]:
        return -np.inf
    away = np.subtract(other[:2], place[:2])
    halves, axes = (np.array(size[:2]) / 2, np.array(other_size[:2]) / 2), (turn(place[3]), turn(other[3]))
    reach = [abs(axes[0].T @ axes[1]) @ halves[1] + halves[0] + _GAP - abs(axes[0].T @ away)]
    return float(np.min(reach))


def turn(yaw: float) -> NDArray[np.float64]:
    return np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])


@settings(max_examples=60, deadline=None)
@given(st.lists(places, max_size=6), sizes, st.lists(st.tuples(places, sizes), max_size=4))
def test_places_touch_the_boxes_that_overlap_along_both_axes_of_the_object(
    where: list[Place], size: Size, others: list[tuple[Place, Size]]
) -> None:
    boxes = [box_of(((x, y, z), yaw_quaternion(yaw)), other) for (x, y, z, yaw), other in others]
    found = touching(np.array(where).reshape(-1, 4), size, np.array(boxes).reshape(-1, 7))
    depths = np.array([[overlap(place, size, other, own) for other, own in others] for place in where])
    for touches, depth in zip(found, depths.reshape(len(where), len(others)).max(axis=1, initial=-np.inf), strict=True):
        if abs(depth) > 1e-9:
            assert touches == (depth > 0)


@pytest.mark.parametrize("count", [0, 3])
def test_nothing_is_touched_where_nothing_stands(count: int) -> None:
    assert not touching(np.zeros((count, 4)), (0.1, 0.1, 0.1), np.zeros((0, 7))).any()
