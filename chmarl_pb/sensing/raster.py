"""Draws bodies into views of the empty home as TinyRenderer would, but only the pixels that they cover.

A body that lies outside the view, or that the home hides, is found out before its triangles are
looked at.
"""

from typing import NamedTuple

import numpy as np

from chmarl_pb.sensing.placing import multiply
from chmarl_pb.sensing.triangles import ONE, TWO, ZERO, Floats, compiled, dot4, fill, fill_clipped, screen

TILE = 8  # pixels: side of the squares in which a body that the home hides is found out


class Scratch(NamedTuple):
    """Room for the corners of one part.

    Attributes:
        clip: (n, 4) in clip coordinates.
        pixels: (n, 2) in pixels.
        normals: (m, 3) in the world.
    """

    clip: Floats
    pixels: Floats
    normals: Floats


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
def _extent(ball, lens, tiles, size):  # type: ignore[no-untyped-def]
    """Return first and last column, first and last row that a ball can touch; 0, -1, 0, -1 if it cannot be seen."""
    centre = np.empty(3)
    for i in range(3):
        row = lens.world_to_camera[i]
        centre[i] = row[0] * ball[0] + row[1] * ball[1] + row[2] * ball[2] + row[3]
    radius, ahead, near, far = ball[3], -centre[2], np.float64(lens.planes[0]), np.float64(lens.planes[1])
    if ahead + radius <= near or ahead - radius >= far:
        return 0, -1, 0, -1
    nearest = ahead - radius
    if nearest <= near:
        return 0, size - 1, 0, size - 1
    bounds = np.empty((2, 2))
    for i in range(2):
        scale = np.float64(lens.projection[i, i]) * size / 2
        low, high = centre[i] - radius, centre[i] + radius
        # What lies left of the axis is farthest to the left where it is nearest, else where it is farthest away.
        bounds[i, 0] = size / 2 + scale * low / (nearest if low < 0 else ahead + radius) - 1
        bounds[i, 1] = size / 2 + scale * high / (nearest if high > 0 else ahead + radius) + 1
        if bounds[i, 0] > size - 1 or bounds[i, 1] < 0:
            return 0, -1, 0, -1
    left, right = int(max(0.0, bounds[0, 0])), int(min(size - 1.0, bounds[0, 1]))
    top, bottom = int(max(0.0, size - 1 - bounds[1, 1])), int(min(size - 1.0, size - 1 - bounds[1, 0]))
    shortened = nearest * 0.999  # far more than rounding can matter
    depth = far * (shortened - near) / (shortened * (far - near))
    for i in range(top // TILE, bottom // TILE + 1):
        for j in range(left // TILE, right // TILE + 1):
            if tiles[i, j] >= depth:
                return left, right, top, bottom
    return 0, -1, 0, -1


@compiled
def _project(part, models, placed, lens, half, scratch, shaded):  # type: ignore[no-untyped-def]
    """Set the scratch to a part's vertices as the camera has them, and to its normals in the world."""
    frame = placed.frames[models.frame[part]]
    view, product = np.empty((4, 4), np.float32), np.empty((4, 4), np.float32)
    multiply(lens.world_to_camera, frame, view)
    multiply(lens.projection, view, product)
    start = models.first_vertex[part]
    for number in range(start, models.first_vertex[part + 1]):
        x, y, z = models.vertices[number, 0], models.vertices[number, 1], models.vertices[number, 2]
        own = number - start
        for i in range(4):
            scratch.clip[own, i] = dot4(product[i, 0], product[i, 1], product[i, 2], product[i, 3], x, y, z, ONE)
        for i in range(2):
            scratch.pixels[own, i] = screen(scratch.clip[own, i], scratch.clip[own, 3], half)
    if shaded:
        inverse = placed.inverses[models.frame[part]]
        start = models.first_normal[part]
        for number in range(start, models.first_normal[part + 1]):
            x, y, z = models.normals[number, 0], models.normals[number, 1], models.normals[number, 2]
            for i in range(3):
                scratch.normals[number - start, i] = dot4(
                    inverse[i, 0], inverse[i, 1], inverse[i, 2], inverse[i, 3], x, y, z, ZERO
                )


@compiled
def _draw_part(part, owner, models, placed, lens, light, canvas, scratch, shaded):  # type: ignore[no-untyped-def]
    """Draw the triangles of one part that face the camera."""
    size = canvas.home.shape[0]
    _project(part, models, placed, lens, np.float32(size) / TWO, scratch, shaded)
    points, pixels, normals = np.empty((3, 4), np.float32), np.empty((3, 2), np.float32), np.empty((3, 3), np.float32)
    eye, sides, corners, clip, seen = lens.eye, placed.sides, models.corners, scratch.clip, scratch.pixels
    last = np.float32(size - 1)
    for face in range(models.first_triangle[part], models.first_triangle[part + 1]):
        x, y, z = sides[face, 0] - eye[0], sides[face, 1] - eye[1], sides[face, 2] - eye[2]
        if (x * sides[face, 3] + y * sides[face, 4]) + z * sides[face, 5] >= 0:
            continue
        a, b, c = corners[face, 0], corners[face, 1], corners[face, 2]
        behind = int(clip[a, 3] < 0) + int(clip[b, 3] < 0) + int(clip[c, 3] < 0)
        if behind == 0:
            across = _spans_pixel(seen[a, 0], seen[b, 0], seen[c, 0], last)
            if not (across and _spans_pixel(seen[a, 1], seen[b, 1], seen[c, 1], last)):
                continue
        elif behind == 3:
            continue
        _gather(corners[face], scratch, points, pixels, normals, shaded)
        if behind == 0:
            fill(
                points, pixels, points, pixels, False, models.colour[part], normals, owner, lens, light, canvas, shaded
            )
        else:
            fill_clipped(points, pixels, models.colour[part], normals, owner, lens, light, canvas, shaded)


@compiled
def _gather(corners, scratch, points, pixels, normals, shaded):  # type: ignore[no-untyped-def]
    """Copy what the scratch holds of one triangle."""
    for i in range(3):
        for k in range(4):
            points[i, k] = scratch.clip[corners[i], k]
        for k in range(2):
            pixels[i, k] = scratch.pixels[corners[i], k]
        if shaded:
            for k in range(3):
                normals[i, k] = scratch.normals[corners[3 + i], k]


@compiled
def _spans_pixel(a, b, c, last):  # type: ignore[no-untyped-def]
    """Return whether a whole number from 0 to ``last`` lies between the least and the greatest of three."""
    return np.ceil(max(ZERO, min(a, b, c))) <= min(last, max(a, b, c))


@compiled
def draw(bodies, first, models, placed, lens, light, tiles, canvas, scratch, shaded):  # type: ignore[no-untyped-def]
    """Draw bodies where they are nearer than the empty home.

    Args:
        bodies: (n,) numbers of the bodies, in the order in which TinyRenderer draws them.
        first: owner of the pixels of body 0.
        models: the :class:`Models`.
        placed: where they are, :class:`Placed`.
        lens: the camera.
        light: the light.
        tiles: what :func:`farthest` makes of the home's depth.
        canvas: what to draw on, with the home's depth.
        scratch: room for the largest part.
        shaded: whether depth and colour are wanted beside the owners.

    Returns:
        First and last column, first and last row of the part of the picture that may have changed.
    """
    size = canvas.home.shape[0]
    left, right, top, bottom = size, -1, size, -1
    for body in bodies:
        low, high, upper, lower = _extent(placed.balls[body], lens, tiles, size)
        if high < low:
            continue
        left, right, top, bottom = min(left, low), max(right, high), min(top, upper), max(bottom, lower)
        for part in range(models.first_part[body], models.first_part[body + 1]):
            _draw_part(part, first + body, models, placed, lens, light, canvas, scratch, shaded)
    return left, right, top, bottom


@compiled
def count(bodies, first, models, placed, lens, light, tiles, canvas, scratch, links, pixels):  # type: ignore[no-untyped-def]
    """Correct the numbers of pixels in which the things of the empty home are seen by what moves before them.

    It takes what :func:`draw` takes, with a clean canvas that is clean again afterwards; ``links`` (size, size), the
    number of the home's thing at each pixel, -1 for nothing; and ``pixels`` (n,) by owner, which it changes.
    """
    left, right, top, bottom = draw(bodies, first, models, placed, lens, light, tiles, canvas, scratch, False)
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            owner = canvas.owner[row, column]
            if owner >= 0:
                pixels[owner] += 1
                if links[row, column] >= 0:
                    pixels[links[row, column]] -= 1
                canvas.owner[row, column] = -1
                canvas.raw[row, column] = -np.inf
