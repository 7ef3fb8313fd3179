"""Puts a frame of the video together: the views, the map and the panel around them."""

from collections.abc import Iterable, Iterator
from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.viewer import panel
from chmarl_pb.viewer.canvas import PAPER
from chmarl_pb.viewer.film import Shot
from chmarl_pb.viewer.plan_map import PlanMap
from chmarl_pb.viewer.record import Recording

Image = NDArray[np.uint8]

_CORNER = 10  # pixels


def compose(recording: Recording, shots: list[Shot], views: Iterable[dict[str, Image]]) -> Iterator[Image]:
    """Yield the frame (HEIGHT, WIDTH, 3) of each shot.

    Args:
        recording: the episode.
        shots: of the video, in order.
        views: robot -> its finished view, for each shot.
    """
    plan_map = PlanMap(recording, panel.COLUMN_WIDTH, panel.PICTURE_HEIGHT)
    around, around_of = None, None
    for shot, pictures in zip(shots, views, strict=False):
        if (shot.step, shot.done) != around_of:
            around, around_of = panel.draw_panel(recording, shot.step, shot.done).pixels(), (shot.step, shot.done)
        assert around is not None
        frame = around.copy()
        for (robot, _), left in zip(panel.shown(recording), panel.COLUMNS, strict=False):
            _paste(frame, pictures[robot], left)
        _paste(frame, plan_map.draw(shot.scene), panel.COLUMNS[2])
        yield frame


def _paste(frame: Image, picture: Image, left: int) -> None:
    """Put a picture with rounded corners into the middle of its place."""
    height, width = picture.shape[:2]
    left += (panel.COLUMN_WIDTH - width) // 2
    top = panel.PICTURE_TOP + (panel.PICTURE_HEIGHT - height) // 2
    mask = _rounded(height, width)
    edge = mask < 1
    share = mask[edge, None]
    place = frame[top : top + height, left : left + width]
    place[:] = picture
    place[edge] = share * picture[edge] + (1 - share) * np.array(PAPER, dtype=np.float32) + 0.5


@cache
def _rounded(height: int, width: int) -> NDArray[np.float32]:
    """Return (height, width): 1 inside a box with rounded corners, 0 outside, between on the edge."""
    scale = 4
    mask = np.zeros((height * scale, width * scale), dtype=np.uint8)
    corner, right, bottom = _CORNER * scale, width * scale - 1, height * scale - 1
    mask[corner:-corner] = 255
    mask[:, corner:-corner] = 255
    for x in (corner, right - corner):
        for y in (corner, bottom - corner):
            cv2.circle(mask, (x, y), corner, 255, -1)
    small = cv2.resize(mask, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.float32) / np.float32(255)
