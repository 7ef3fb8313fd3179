"""Counts the pixels in which things are seen, and draws no more for it than the answer depends on.

A body that no other overlaps is known to be visible once a few of its pixels are drawn. It is drawn to the end only if
it could hide one of the home's things that few pixels show.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.rendering.bounds import extent, sight_of
from chmarl_pb.rendering.canvas import canvas_of, wipe
from chmarl_pb.rendering.placing import stage_of
from chmarl_pb.rendering.raster import SAFE, draw_part, least_distance, project, span
from chmarl_pb.rendering.triangles import TWO


def count_pixels(segmentation: NDArray[np.integer], length: int) -> NDArray[np.int64]:
    """Return how often each value from 0 stands in a segmentation, at least ``length`` of them."""
    counts: NDArray[np.int64] = _count(segmentation, length)
    return counts


@compiled
def _count(segmentation, length):  # type: ignore[no-untyped-def]
    most = length - 1
    for row in segmentation:
        for value in row:
            most = max(most, int(value))
    counts = np.zeros(most + 1, np.int64)
    for row in segmentation:
        for value in row:
            if value >= 0:
                counts[value] += 1
    return counts


class Shown(NamedTuple):
    """What a view of the empty home shows.

    Attributes:
        depth: (size, size) in [0, 1].
        links: (size, size) PyBullet link index of the home at each pixel, -1 for nothing.
        tiles: what :func:`chmarl_pb.rendering.bounds.farthest` makes of the depth.
        pixels: number of pixels of each link, by link index; shorter than the list of links at its end.
    """

    depth: NDArray[np.float32]
    links: NDArray[np.integer]
    tiles: NDArray[np.float32]
    pixels: NDArray[np.int64]


@compiled
def visible(bodies, first, enough, nodes, stage, sight, links, home_pixels, canvas):  # type: ignore[no-untyped-def]
    """Return the numbers of the things of which at least ``enough`` pixels are seen, of those that are ``nodes`` (n,).

    The other arguments are those of :func:`count`.
    """
    pixels = np.zeros(len(nodes), np.int64)
    count(bodies, first, enough, stage, sight, links, home_pixels, canvas, pixels)
    found, shown = np.empty(len(nodes), np.int64), 0  # loops compile much faster than expressions of arrays
    for number in range(len(nodes)):
        if nodes[number] and pixels[number] >= enough:
            found[shown] = number
            shown += 1
    return found[:shown]


@compiled
def count(bodies, first, enough, stage, sight, links, home_pixels, canvas, pixels):  # type: ignore[no-untyped-def]
    """Count the pixels in which each thing is seen; counts that reach ``enough`` are right in that alone.

    Args:
        bodies: (n,) numbers of the bodies, in the order in which TinyRenderer draws them.
        first: number of body 0 as a thing.
        enough: number of pixels.
        stage: the words of the :class:`chmarl_pb.rendering.placing.Stage` that they are on.
        sight: the words of the camera's :class:`chmarl_pb.rendering.bounds.Sight` of the empty home.
        links: as :class:`Shown` has them.
        home_pixels: the same.
        canvas: the words of a clean canvas; it is clean again afterwards.
        pixels: (things,) zeros, set to the counts.
    """
    (models, placed, scratch), (lens, depth, tiles) = stage_of(stage), sight_of(sight)
    home, drawn = Shown(depth, links, tiles, home_pixels), canvas_of(canvas)
    enough_for_all = home.depth.size + 1
    shown, boxes = _in_view(bodies, models, placed, lens, home, scratch)
    left = _left_over(boxes, home)
    for number, body in enumerate(shown):
        whole = _overlaps(number, boxes) or _endangers(boxes[number], home, left, enough)
        _draw(body, enough_for_all if whole else enough, models, placed, lens, home.depth, drawn, scratch)
    for thing in range(len(home.pixels)):
        pixels[thing] = home.pixels[thing]
    for box in boxes:
        _take_off(box, first, models, home.links, drawn, pixels)


@compiled
def _in_view(bodies, models, placed, lens, home, scratch):  # type: ignore[no-untyped-def]
    """Project the bodies that may be seen; return their numbers (k,) and the pixels (k, 4) in which their corners lie.

    The pixels are as first and last column, first and last row.
    """
    shown, boxes = np.empty(len(bodies), np.int64), np.empty((len(bodies), 4), np.int64)
    count, size = 0, len(home.depth)
    for body in bodies:
        box = boxes[count]
        box[0], box[1], box[2], box[3] = extent(placed.balls[body], lens, home.tiles, size)
        if box[1] >= box[0]:
            for part in range(models.first_part[body], models.first_part[body + 1]):
                project(part, models, placed.frames[models.frame[part]], lens, np.float32(size) / TWO, scratch)
            nearest = _tighten(body, models, lens, size, scratch, box)
            if not _is_behind(nearest, box, home.depth):
                shown[count] = body
                count += 1
    return shown[:count], boxes[:count]


@compiled
def _overlaps(number, boxes):  # type: ignore[no-untyped-def]
    """Return whether one box has pixels in common with another."""
    for other in range(len(boxes)):
        across = boxes[number, 0] <= boxes[other, 1] and boxes[other, 0] <= boxes[number, 1]
        if other != number and across and boxes[number, 2] <= boxes[other, 3] and boxes[other, 2] <= boxes[number, 3]:
            return True
    return False


@compiled
def _tighten(body, models, lens, size, scratch, box):  # type: ignore[no-untyped-def]
    """Cut a box down to the pixels in which the corners of a projected body lie; to none if it is not in view.

    Returns:
        A depth in [0, 1] than which nothing of it is nearer.
    """
    first, last = models.first_part[body], models.first_part[body + 1]
    corners = scratch[models.first_vertex[first] : models.first_vertex[last]]
    if least_distance(corners) <= 0:  # a corner behind the camera lies anywhere in the picture
        if _is_beyond(corners):
            box[0], box[1], box[2], box[3] = 0, -1, 0, -1
        return -np.inf
    left, right, top, bottom, nearest = span(corners, lens, size)
    box[0], box[1], box[2], box[3] = max(box[0], left), min(box[1], right), max(box[2], top), min(box[3], bottom)
    return nearest


@compiled
def _is_beyond(corners):  # type: ignore[no-untyped-def]
    """Return whether all of some projected corners (n, 6) lie beyond the same side of the picture."""
    left, right, low, high = True, True, True, True
    for row in corners:
        x, y, w = row[4], row[5], row[3]
        left, right = left and x < -w - SAFE, right and x > w + SAFE
        low, high = low and y < -w - SAFE, high and y > w + SAFE
    return left or right or low or high


@compiled
def _is_behind(nearest, box, depth):  # type: ignore[no-untyped-def]
    """Return whether the home hides all of a box that has nothing nearer than a depth; so it does an empty box."""
    for row in range(box[2], box[3] + 1):
        for column in range(box[0], box[1] + 1):
            if depth[row, column] > nearest:
                return False
    return True


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
def _draw(body, enough, models, placed, lens, depth, canvas, scratch):  # type: ignore[no-untyped-def]
    """Draw a projected body until it has ``enough`` pixels."""
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
            wipe(canvas, row, column)
