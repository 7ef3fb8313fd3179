"""What triangles are drawn on."""

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.packed import Packed, line, table


class Canvas(NamedTuple):
    """What is drawn on, rows from the top.

    Attributes:
        raw: (size, size) TinyRenderer's own depth of what is drawn, before it is rounded to single precision: minus
            infinity where nothing is.
        nearness: (size, size) reciprocal of its distance along the camera's axis, 1/metres, 0 where nothing is.
        face: (size, size) number of the triangle that is seen there, -1 for none.
        depths: (size,) room for the depths of a triangle in one row of pixels.
        nears: (size,) room for its nearness there.
    """

    raw: NDArray[np.float64]
    nearness: NDArray[np.float32]
    face: NDArray[np.int32]
    depths: NDArray[np.float64]
    nears: NDArray[np.float64]


def clean_canvas(size: int) -> Canvas:
    """Return a canvas with nothing drawn."""
    shape, room = (size, size), (np.empty(size), np.empty(size))
    return Canvas(np.full(shape, -np.inf), np.zeros(shape, np.float32), np.full(shape, -1, np.int32), *room)


def pack(canvas: Canvas) -> Packed:
    """Return a canvas as compiled functions take it."""
    return Packed(canvas, (("f8", 2), ("f4", 2), ("i4", 2), ("f8", 1), ("f8", 1)))


@cache
def canvas(size: int) -> Packed:
    """Return the process's canvas of a size, packed, which everybody leaves clean."""
    return pack(clean_canvas(size))


@compiled
def canvas_of(words):  # type: ignore[no-untyped-def]
    """Return a packed canvas."""
    raw, nearness, face = table(words, 0, np.float64), table(words, 1, np.float32), table(words, 2, np.int32)
    return Canvas(raw, nearness, face, line(words, 3, np.float64), line(words, 4, np.float64))


@compiled
def wipe(canvas, row, column):  # type: ignore[no-untyped-def]
    """Take away what is drawn at a pixel."""
    canvas.raw[row, column], canvas.nearness[row, column], canvas.face[row, column] = -np.inf, np.float32(0), -1
