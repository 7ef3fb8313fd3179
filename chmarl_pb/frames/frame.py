"""Puts a frame together: the views, the map and the panel around them."""

from functools import cache

import cv2
import numpy as np
from numpy.typing import NDArray

from chmarl_pb.frames import panel
from chmarl_pb.frames.canvas import PAPER
from chmarl_pb.frames.recording import Recording

Image = NDArray[np.uint8]

VIEW_SIZE = 400  # pixels of a finished view
_CORNER = 10  # pixels


def put_together(recording: Recording, around: Image, views: dict[str, Image], plan: Image) -> Image:
    """Return a frame (HEIGHT, WIDTH, 3).

    Args:
        recording: the episode.
        around: the panel, which is left as it is.
        views: robot -> its finished view.
        plan: the map.
    """
    frame = around.copy()
    for (robot, _), left in zip(panel.shown(recording), panel.COLUMNS, strict=False):
        _paste(frame, views[robot], left)
    _paste(frame, plan, panel.COLUMNS[2])
    return frame


def shrunk(picture: Image) -> Image:
    """Return a picture as a finished view."""
    return np.asarray(cv2.resize(picture, (VIEW_SIZE, VIEW_SIZE), interpolation=cv2.INTER_AREA), dtype=np.uint8)


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
