"""Counts the pixels in which things are seen, and draws no more for it than the answer depends on.

A body that no other overlaps is known to be visible once a few of its pixels are drawn. It is drawn to the end only if
it could hide one of the home's things that few pixels show.
"""

import numpy as np

from chmarl_pb.compiled import compiled
from chmarl_pb.rendering.bounds import extent
from chmarl_pb.rendering.raster import SAFE, draw_part, project
from chmarl_pb.rendering.triangles import TWO


@compiled
def visible(bodies, first, enough, nodes, models, placed, lens, home, canvas, scratch):  # type: ignore[no-untyped-def]
    """Return the numbers of the things of which at least ``enough`` pixels are seen, of those that are ``nodes`` (n,).

    The other arguments are those of :func:`count`.
    """
    pixels = np.zeros(len(nodes), np.int64)
    count(bodies, first, enough, models, placed, lens, home, canvas, scratch, pixels)
    found, shown = np.empty(len(nodes), np.int64), 0  # loops compile much faster than expressions of arrays
    for number in range(len(nodes)):
        if nodes[number] and pixels[number] >= enough:
            found[shown] = number
            shown += 1
    return found[:shown]


@compiled
def count(bodies, first, enough, models, placed, lens, home, canvas, scratch, pixels):  # type: ignore[no-untyped-def]
    """Count the pixels in which each thing is seen; counts that reach ``enough`` are right in that alone.

    Args:
        bodies: (n,) numbers of the bodies, in the order in which TinyRenderer draws them.
        first: number of body 0 as a thing.
        enough: number of pixels.
        models: the :class:`chmarl_pb.rendering.placing.Models`.
        placed: where they are, :class:`chmarl_pb.rendering.placing.Placed`.
        lens: the camera.
        home: the empty home as the camera sees it, :class:`chmarl_pb.rendering.home_views.Shown`.
        canvas: a clean canvas; it is clean again afterwards.
        scratch: room for the corners, see :func:`chmarl_pb.rendering.raster.draw`.
        pixels: (things,) zeros, set to the counts.
    """
    size = home.depth.shape[0]
    boxes, tight = np.empty((len(bodies), 4), np.int64), np.zeros(len(bodies), np.bool_)
    for number, body in enumerate(bodies):
        box = boxes[number]
        box[0], box[1], box[2], box[3] = extent(placed.balls[body], lens, home.tiles, size)
    for number, body in enumerate(bodies):
        if _overlaps(number, boxes):
            _tighten(body, models, placed, lens, size, scratch, boxes[number])
            tight[number] = True
    left = _left_over(boxes, home)
    for number, body in enumerate(bodies):
        if boxes[number, 1] >= boxes[number, 0]:
            whole = _overlaps(number, boxes) or _endangers(boxes[number], home, left, enough)
            wanted = size * size + 1 if whole else enough
            _draw(body, wanted, tight[number], models, placed, lens, home.depth, canvas, scratch)
    for thing in range(len(home.pixels)):
        pixels[thing] = home.pixels[thing]
    for number in range(len(bodies)):
        _take_off(boxes[number], first, models, home.links, canvas, pixels)


@compiled
def _overlaps(number, boxes):  # type: ignore[no-untyped-def]
    """Return whether one box has pixels in common with another."""
    if boxes[number, 1] < boxes[number, 0]:
        return False
    for other in range(len(boxes)):
        across = boxes[number, 0] <= boxes[other, 1] and boxes[other, 0] <= boxes[number, 1]
        if other != number and across and boxes[number, 2] <= boxes[other, 3] and boxes[other, 2] <= boxes[number, 3]:
            return True
    return False


@compiled
def _tighten(body, models, placed, lens, size, scratch, box):  # type: ignore[no-untyped-def]
    """Project a body, and cut a box down to the pixels in which its corners lie; 0, -1, 0, -1 if there are none."""
    _project(body, models, placed, lens, size, scratch)
    low_x, low_y, high_x, high_y, ahead = np.inf, np.inf, -np.inf, -np.inf, True
    left, right, low, high = True, True, True, True  # whether all corners lie beyond that side of the picture
    first, last = models.first_part[body], models.first_part[body + 1]
    for row in scratch[models.first_vertex[first] : models.first_vertex[last]]:
        x, y, w = row[4], row[5], row[3]
        left, right, low, high = (
            left and x < -w - SAFE,
            right and x > w + SAFE,
            low and y < -w - SAFE,
            high and y > w + SAFE,
        )
        ahead = ahead and w > 0
        low_x, low_y = min(low_x, np.float64(row[0])), min(low_y, np.float64(row[1]))
        high_x, high_y = max(high_x, np.float64(row[0])), max(high_y, np.float64(row[1]))
    if ahead:  # a corner behind the camera lies anywhere in the picture
        box[0], box[1] = int(max(box[0], np.ceil(low_x))), int(min(box[1], np.floor(high_x)))
        box[2], box[3] = int(max(box[2], size - 1 - np.floor(high_y))), int(min(box[3], size - 1 - np.ceil(low_y)))
    if left or right or low or high or box[1] < box[0] or box[3] < box[2]:
        box[0], box[1], box[2], box[3] = 0, -1, 0, -1


@compiled
def _project(body, models, placed, lens, size, scratch):  # type: ignore[no-untyped-def]
    for part in range(models.first_part[body], models.first_part[body + 1]):
        project(part, models, placed.frames[models.frame[part]], lens, np.float32(size) / TWO, scratch)


@compiled
def _left_over(boxes, home):  # type: ignore[no-untyped-def]
    """Return how many pixels of each of the home's things would be seen at least, were every box filled."""
    left = home.pixels.copy()
    for left_most, right_most, top, bottom in boxes:
        for row in range(top, bottom + 1):
            for column in range(left_most, right_most + 1):
                if home.links[row, column] >= 0:
                    left[home.links[row, column]] -= 1
    return left


@compiled
def _endangers(box, home, left, enough):  # type: ignore[no-untyped-def]
    """Return whether a box has pixels of a thing that is seen in the empty home, and might not be behind the boxes."""
    for row in range(box[2], box[3] + 1):
        for column in range(box[0], box[1] + 1):
            link = home.links[row, column]
            if link >= 0 and left[link] < enough <= home.pixels[link]:
                return True
    return False


@compiled
def _draw(body, enough, projected, models, placed, lens, depth, canvas, scratch):  # type: ignore[no-untyped-def]
    """Draw a body until it has ``enough`` pixels."""
    if not projected:
        _project(body, models, placed, lens, len(depth), scratch)
    for part in range(models.first_part[body], models.first_part[body + 1]):
        enough -= draw_part(part, enough, models, placed.sides, lens, depth, canvas, scratch)
        if enough <= 0:
            return


@compiled
def _take_off(box, first, models, links, canvas, pixels):  # type: ignore[no-untyped-def]
    """Count the drawn pixels of a box for the bodies, take them off the home's things, and clean the canvas there."""
    for row in range(box[2], box[3] + 1):
        for column in range(box[0], box[1] + 1):
            face = canvas.face[row, column]
            if face < 0:
                continue
            pixels[first + models.body[models.part[face]]] += 1
            if links[row, column] >= 0:
                pixels[links[row, column]] -= 1
            canvas.face[row, column] = -1
            canvas.raw[row, column] = -np.inf
