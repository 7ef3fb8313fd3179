"""Draws bodies into views of the empty home as TinyRenderer would, but only the pixels that they cover.

A body that lies outside the view, or that the home hides, is found out before its triangles are
looked at.
"""

import numpy as np

from chmarl_pb.compiled import compiled
from chmarl_pb.rendering.bounds import extent, sight_of
from chmarl_pb.rendering.canvas import canvas_of, wipe
from chmarl_pb.rendering.placing import multiply, stage_of
from chmarl_pb.rendering.shading import brightness, normal_at, weights_at
from chmarl_pb.rendering.triangles import (
    CLOSE,
    ONE,
    SURELY,
    TWO,
    ZERO,
    corner_of,
    cover,
    cover_clipped,
    depth_of,
    dot4,
    screen,
)

SAFE = np.float32(1e-3)  # metres: far more than rounding can matter
ROUNDING = 2e-6  # of depths in [0, 1]: far more than it can be


@compiled
def project(part, models, frame, lens, half, scratch):  # type: ignore[no-untyped-def]
    """Set a part's rows of the scratch to its corners as the camera has them."""
    view, product = np.empty((4, 4), np.float32), np.empty((4, 4), np.float32)
    multiply(lens.world_to_camera, frame, view)
    multiply(lens.projection, view, product)
    for number in range(models.first_vertex[part], models.first_vertex[part + 1]):
        x, y, z = models.vertices[number, 0], models.vertices[number, 1], models.vertices[number, 2]
        row = scratch[number]
        row[4] = dot4(product[0, 0], product[0, 1], product[0, 2], product[0, 3], x, y, z, ONE)
        row[5] = dot4(product[1, 0], product[1, 1], product[1, 2], product[1, 3], x, y, z, ONE)
        row[2] = dot4(product[2, 0], product[2, 1], product[2, 2], product[2, 3], x, y, z, ONE)
        row[3] = dot4(product[3, 0], product[3, 1], product[3, 2], product[3, 3], x, y, z, ONE)
        row[0], row[1] = screen(row[4], row[3], half), screen(row[5], row[3], half)


@compiled
def draw_part(part, enough, models, sides, lens, home, canvas, scratch):  # type: ignore[no-untyped-def]
    """Draw the triangles of one part that face the camera, when its corners have been projected.

    Args:
        part: number of the part.
        enough: number of clean pixels after which the rest need not be drawn.
        models: the :class:`chmarl_pb.rendering.placing.Models`.
        sides: of :class:`chmarl_pb.rendering.placing.Placed`.
        lens: the camera.
        home: (size, size) depth of the empty home, in [0, 1].
        canvas: what to draw on.
        scratch: as :func:`draw` has it, set by :func:`project`.

    Returns:
        How many of the drawn pixels were clean.
    """
    size, clean = home.shape[0], 0
    eye, corners, last = lens.eye, models.corners, np.float32(size - 1)
    near, far = lens.planes[0], lens.planes[1]
    for face in range(models.first_triangle[part], models.first_triangle[part + 1]):
        x, y, z = sides[face, 0] - eye[0], sides[face, 1] - eye[1], sides[face, 2] - eye[2]
        if (x * sides[face, 3] + y * sides[face, 4]) + z * sides[face, 5] >= 0:
            continue
        i, j, k = corners[face, 0], corners[face, 1], corners[face, 2]
        behind = int(scratch[i, 3] < 0) + int(scratch[j, 3] < 0) + int(scratch[k, 3] < 0)
        if behind == 0:
            across = _spans_pixel(scratch[i, 0], scratch[j, 0], scratch[k, 0], last)
            if across and _spans_pixel(scratch[i, 1], scratch[j, 1], scratch[k, 1], last):
                a, b, c = corner_of(scratch[i]), corner_of(scratch[j]), corner_of(scratch[k])
                clean += cover(
                    a, b, c, behind > 0, face, near, far, home, canvas.raw, canvas.nearness, canvas.face,
                    canvas.depths, canvas.nears,
                )  # fmt: skip
        elif behind < 3 and not outside(scratch[i], scratch[j], scratch[k]):
            clean += cover_clipped(
                _rows_of(scratch, i, j, k), face, near, far, home, canvas.raw, canvas.nearness, canvas.face,
                canvas.depths, canvas.nears,
            )  # fmt: skip
        if clean >= enough:
            break
    return clean


@compiled
def outside(a, b, c):  # type: ignore[no-untyped-def]
    """Return whether three corners, rows of the scratch, lie beyond the same side of the picture."""
    return (
        (a[4] < -a[3] - SAFE and b[4] < -b[3] - SAFE and c[4] < -c[3] - SAFE)
        or (a[4] > a[3] + SAFE and b[4] > b[3] + SAFE and c[4] > c[3] + SAFE)
        or (a[5] < -a[3] - SAFE and b[5] < -b[3] - SAFE and c[5] < -c[3] - SAFE)
        or (a[5] > a[3] + SAFE and b[5] > b[3] + SAFE and c[5] > c[3] + SAFE)
    )


@compiled
def _spans_pixel(a, b, c, last):  # type: ignore[no-untyped-def]
    """Return whether a whole number from 0 to ``last`` lies between the least and the greatest of three."""
    return np.ceil(max(ZERO, min(a, b, c))) <= min(last, max(a, b, c))


@compiled
def _rows_of(scratch, i, j, k):  # type: ignore[no-untyped-def]
    """Return the rows of three corners; entry by entry, which compiles much faster than row by row."""
    rows = np.empty((3, 6), np.float32)
    for place, corner in enumerate((i, j, k)):
        for column in range(6):
            rows[place, column] = scratch[corner, column]
    return rows


@compiled
def draw(bodies, models, placed, lens, home, tiles, canvas, scratch):  # type: ignore[no-untyped-def]
    """Draw bodies where they are nearer than the empty home.

    Args:
        bodies: (n,) numbers of the bodies, in the order in which TinyRenderer draws them.
        models: the :class:`chmarl_pb.rendering.placing.Models`.
        placed: where they are, :class:`chmarl_pb.rendering.placing.Placed`.
        lens: the camera.
        home: (size, size) depth of the empty home, in [0, 1].
        tiles: what :func:`chmarl_pb.rendering.bounds.farthest` makes of it.
        canvas: what to draw on.
        scratch: (vertices, 6) room for the corners: x and y in pixels, z, w, x and y in clip coordinates.

    Returns:
        (n, 4) first and last column, first and last row of the part of the picture that each body may have changed;
        0, -1, 0, -1 if it has not.
    """
    size = home.shape[0]
    boxes = np.empty((len(bodies), 4), np.int64)
    for number in _nearest_first(bodies, placed.balls, lens.eye):
        body = bodies[number]
        box = boxes[number]
        box[0], box[1], box[2], box[3] = 0, -1, 0, -1
        left, right, top, bottom = extent(placed.balls[body], lens, tiles, size)
        if right < left:
            continue
        for part in range(models.first_part[body], models.first_part[body + 1]):
            project(part, models, placed.frames[models.frame[part]], lens, np.float32(size) / TWO, scratch)
            corners = scratch[models.first_vertex[part] : models.first_vertex[part + 1]]
            if not _is_hidden(corners, lens, home, canvas.nearness):
                draw_part(part, size * size + 1, models, placed.sides, lens, home, canvas, scratch)
                box[0], box[1], box[2], box[3] = left, right, top, bottom
    return boxes


@compiled
def least_distance(corners):  # type: ignore[no-untyped-def]
    """Return the least distance along the camera's axis of projected corners (n, 6), metres; below 0 behind it."""
    least = np.inf
    for row in corners:
        least = min(least, np.float64(row[3]))
    return least


@compiled
def span(corners, lens, size):  # type: ignore[no-untyped-def]
    """Return in which pixels projected corners (n, 6) before the camera lie, and a depth than which none is nearer.

    Returns:
        First and last column, first and last row, of a picture of a size, and the depth in [0, 1].
    """
    low_x, low_y, high_x, high_y, near_z = np.inf, np.inf, -np.inf, -np.inf, np.inf
    for row in corners:
        near_z = min(near_z, np.float64(row[2]))
        low_x, low_y = min(low_x, np.float64(row[0])), min(low_y, np.float64(row[1]))
        high_x, high_y = max(high_x, np.float64(row[0])), max(high_y, np.float64(row[1]))
    left, right = int(max(0.0, np.ceil(low_x))), int(min(size - 1.0, np.floor(high_x)))
    top, bottom = int(max(0.0, size - 1 - np.floor(high_y))), int(min(size - 1.0, size - 1 - np.ceil(low_y)))
    depth = np.float64(depth_of(np.float32(-near_z), lens.planes[0], lens.planes[1])) - ROUNDING
    return left, right, top, bottom, depth


@compiled
def _is_hidden(corners, lens, home, nearness):  # type: ignore[no-untyped-def]
    """Return whether the home, and what is drawn already, surely hide a part with such projected corners (n, 6).

    So they do if it is not in view. A part that reaches close to the camera is not looked at.
    """
    least = least_distance(corners)
    if least < CLOSE:
        return False
    left, right, top, bottom, depth = span(corners, lens, len(home))
    nearest = SURELY / least
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            if nearness[row, column] <= nearest and home[row, column] > depth:
                return False
    return True


@compiled
def _nearest_first(bodies, balls, eye):  # type: ignore[no-untyped-def]
    """Return the places (n,) of bodies in their list, in the order in which they end before the camera.

    What is near then hides what is behind it before that is drawn; floors and walls mostly come last.
    """
    order, distances = np.empty(len(bodies), np.int64), np.empty(len(bodies))
    for number in range(len(bodies)):
        ball, square = balls[bodies[number]], 0.0
        for axis in range(3):
            square += (ball[axis] - eye[axis]) ** 2
        distance, place = np.sqrt(square) + ball[3], number
        while place > 0 and distances[place - 1] > distance:
            distances[place], order[place] = distances[place - 1], order[place - 1]
            place -= 1
        distances[place], order[place] = distance, number
    return order


@compiled
def paint(bodies, stage, sight, light, canvas, colour):  # type: ignore[no-untyped-def]
    """Draw bodies into a picture's ``colour`` (size, size, 3 or 4) alone.

    Args:
        bodies: (n,) numbers of the bodies, in the order in which TinyRenderer draws them.
        stage: the words of the :class:`chmarl_pb.rendering.placing.Stage` that they are on.
        sight: the words of the camera's :class:`chmarl_pb.rendering.bounds.Sight` of the empty home.
        light: the :class:`chmarl_pb.rendering.shading.Light`.
        canvas: the words of a clean canvas; it is clean again afterwards.
        colour: the picture.
    """
    (models, placed, scratch), (lens, home, tiles) = stage_of(stage), sight_of(sight)
    drawn = canvas_of(canvas)
    boxes = draw(bodies, models, placed, lens, home, tiles, drawn, scratch)
    _shade(boxes, models, placed, light, drawn.face, scratch, colour)
    _wipe_all(boxes, drawn)


@compiled
def picture(bodies, first, stage, sight, light, canvas, shaded, colour, depth, links):  # type: ignore[no-untyped-def]
    """Draw bodies into a picture.

    As :func:`paint`; ``depth`` and ``links`` (size, size) are changed as well, ``links`` to the numbers of the bodies
    from ``first`` on. ``colour`` is left as it is unless the picture is to be ``shaded``, which takes half of the time.
    """
    (models, placed, scratch), (lens, home, tiles) = stage_of(stage), sight_of(sight)
    drawn = canvas_of(canvas)
    boxes = draw(bodies, models, placed, lens, home, tiles, drawn, scratch)
    if shaded:
        _shade(boxes, models, placed, light, drawn.face, scratch, colour)
    near, far, raw, faces = lens.planes[0], lens.planes[1], drawn.raw, drawn.face
    left, right, top, bottom = _union(boxes)
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            face = faces[row, column]
            if face >= 0:
                depth[row, column] = depth_of(np.float32(raw[row, column]), near, far)
                links[row, column] = first + models.body[models.part[face]]
    _wipe_all(boxes, drawn)


@compiled
def _shade(boxes, models, placed, light, faces, scratch, colour):  # type: ignore[no-untyped-def]
    """Set the colours of the pixels in which triangles are seen."""
    rows, normals = np.empty((3, 6), np.float32), np.empty((3, 3), np.float32)
    known, last = -1, colour.shape[0] - 1
    normal, reflected, ambient = (ZERO, ZERO, ZERO), ZERO, light.coefficients[0]
    left, right, top, bottom = _union(boxes)
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            face = faces[row, column]
            if face < 0:
                continue
            part, corners = models.part[face], models.corners[face]
            if face != known:  # most neighbours are of one triangle
                known, rows = face, _rows_of(scratch, corners[0], corners[1], corners[2])
                _turn_normals(corners, models.normals, placed.inverses[models.frame[part]], normals)
            b0, b1, b2 = weights_at(rows, np.float64(column), np.float64(last - row))
            new = normal_at(normals, b0, b1, b2)
            if new != normal:  # on level faces most neighbours have the same
                normal, reflected = new, brightness(new[0], new[1], new[2], light)
            for i in range(3):
                own = np.float32(models.colour[part, i])
                colour[row, column, i] = min(int(ambient * own + reflected * own), 255)


@compiled
def _union(boxes):  # type: ignore[no-untyped-def]
    """Return the smallest box around boxes."""
    left, right, top, bottom = 1 << 30, -1, 1 << 30, -1
    for number in range(len(boxes)):
        if boxes[number, 1] >= boxes[number, 0]:
            left, right = min(left, boxes[number, 0]), max(right, boxes[number, 1])
            top, bottom = min(top, boxes[number, 2]), max(bottom, boxes[number, 3])
    return left, right, top, bottom


@compiled
def _wipe_all(boxes, canvas):  # type: ignore[no-untyped-def]
    """Make a canvas clean again."""
    left, right, top, bottom = _union(boxes)
    for row in range(top, bottom + 1):
        for column in range(left, right + 1):
            if canvas.face[row, column] >= 0:
                wipe(canvas, row, column)


@compiled
def _turn_normals(corners, normals, inverse, out):  # type: ignore[no-untyped-def]
    """Set ``out`` (3, 3) to the normals of a triangle's corners in the world."""
    for k in range(3):
        normal = normals[corners[3 + k]]
        for i in range(3):
            out[k, i] = dot4(
                inverse[i, 0], inverse[i, 1], inverse[i, 2], inverse[i, 3], normal[0], normal[1], normal[2], ZERO
            )
