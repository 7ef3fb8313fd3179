"""The models of bodies and where they are: what a picture needs of bodies before there is a camera.

The matrices are worked out with the arithmetic of Bullet and TinyRenderer, see
:mod:`chmarl_pb.rendering.triangles`. What depends on the bodies alone is done once, when they are put in
their places.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.packed import Packed, block, line, table
from chmarl_pb.rendering.triangles import ONE, ZERO, Floats, Lens, dot4


class Models(NamedTuple):
    """Bodies made of parts: a part is a mesh of one colour, fixed to one frame.

    Attributes:
        first_part: (bodies + 1,) where each body's parts begin.
        frame: (parts,) number of the frame that a part is fixed to.
        first_triangle: (parts + 1,) where each part's triangles begin.
        first_vertex: (parts + 1,) where its vertices begin.
        colour: (parts, 3) bytes red, green, blue.
        vertices: (n, 3) in their frame, metres.
        normals: (m, 3) in their frame.
        corners: (triangles, 6) three numbers of vertices and three of normals.
        part: (triangles,) number of the part that each belongs to.
        body: (parts,) number of the body that each belongs to.
    """

    first_part: NDArray[np.int32]
    frame: NDArray[np.int32]
    first_triangle: NDArray[np.int32]
    first_vertex: NDArray[np.int32]
    colour: NDArray[np.uint8]
    vertices: Floats
    normals: Floats
    corners: NDArray[np.int32]
    part: NDArray[np.int32]
    body: NDArray[np.int32]


class Placed(NamedTuple):
    """Where bodies are.

    Attributes:
        frames: (frames, 4, 4) from each frame to the world.
        inverses: (frames, 4, 4) their inverses, transposed.
        sides: (triangles, 6) a corner and the outward normal (not of unit length) of each triangle, in the world.
        balls: (bodies, 4) x, y, z and radius of a ball around each body, metres.
    """

    frames: Floats
    inverses: Floats
    sides: NDArray[np.float64]
    balls: NDArray[np.float64]


class Stage:
    """Bodies and where they are, ready to be drawn.

    Attributes:
        models: their meshes.
        placed: their places, as :func:`put` and :func:`put_each` set them.
        words: both, and room for drawing, as compiled functions take them.
    """

    def __init__(self, models: Models, frames: int, scratch: Floats | None = None):
        """Begin with nothing in place.

        Args:
            models: the meshes.
            frames: number of frames in all.
            scratch: room for drawing, see :func:`chmarl_pb.rendering.raster.draw`; those who share it draw in turns.
        """
        inverses = np.zeros((frames, 4, 4), np.float32)
        sides, balls = np.zeros((len(models.corners), 6)), np.zeros((len(models.first_part) - 1, 4))
        self.models, self.placed = models, Placed(np.zeros_like(inverses), inverses, sides, balls)
        scratch = np.empty((len(models.vertices), 6), np.float32) if scratch is None else scratch
        self._packed = Packed((*self.models, *self.placed, scratch), _STAGE)
        self.words: Any = self._packed.words


#: The arrays of a stage: models, places and the scratch.
_STAGE = (
    *[("i4", 1)] * 4, ("u1", 2), *[("f4", 2)] * 2, ("i4", 2), *[("i4", 1)] * 2,
    *[("f4", 3)] * 2, *[("f8", 2)] * 2, ("f4", 2),
)  # fmt: skip


@compiled
def stage_of(words):  # type: ignore[no-untyped-def]
    """Return models, places and scratch of a packed :class:`Stage`."""
    models = Models(
        line(words, 0, np.int32), line(words, 1, np.int32), line(words, 2, np.int32), line(words, 3, np.int32),
        table(words, 4, np.uint8), table(words, 5, np.float32), table(words, 6, np.float32), table(words, 7, np.int32),
        line(words, 8, np.int32), line(words, 9, np.int32),
    )  # fmt: skip
    placed = Placed(
        block(words, 10, np.float32), block(words, 11, np.float32), table(words, 12, np.float64),
        table(words, 13, np.float64),
    )  # fmt: skip
    return models, placed, table(words, 14, np.float32)


@compiled
def multiply(a, b, out):  # type: ignore[no-untyped-def]
    """Set ``out`` to the product of two (4, 4) matrices."""
    for i in range(4):
        for j in range(4):
            out[i, j] = dot4(a[i, 0], a[i, 1], a[i, 2], a[i, 3], b[0, j], b[1, j], b[2, j], b[3, j])


@compiled
def _minor(m, row, column):  # type: ignore[no-untyped-def]
    """Return the determinant of a (4, 4) matrix without a row and a column, developed along its first row."""
    r0, r1, r2 = 0 if row > 0 else 1, 1 if row > 1 else 2, 2 if row > 2 else 3
    c0, c1, c2 = 0 if column > 0 else 1, 1 if column > 1 else 2, 2 if column > 2 else 3
    first = m[r1, c2] * -m[r2, c1] + m[r1, c1] * m[r2, c2]
    second = -(m[r1, c2] * -m[r2, c0] + m[r1, c0] * m[r2, c2])
    third = m[r1, c1] * -m[r2, c0] + m[r1, c0] * m[r2, c1]
    return (m[r0, c2] * third + m[r0, c1] * second) + m[r0, c0] * first


@compiled
def _invert_transpose(m, out):  # type: ignore[no-untyped-def]
    """Set ``out`` to the transpose of the inverse of a (4, 4) matrix."""
    for i in range(4):
        for j in range(4):
            minor = _minor(m, i, j)
            out[i, j] = -minor if (i + j) % 2 else minor
    scale = dot4(out[0, 0], out[0, 1], out[0, 2], out[0, 3], m[0, 0], m[0, 1], m[0, 2], m[0, 3])
    for i in range(4):
        for j in range(4):
            out[i, j] = out[i, j] / scale


def lens_of(view: Floats, projection: Floats) -> Lens:
    """Return a camera from its view and projection matrices, each (4, 4) by rows."""
    inverse = np.empty((4, 4), np.float32)
    _invert_transpose(view, inverse)
    slope, shift = projection[2, 2], projection[2, 3]
    planes = np.array([shift / (slope - ONE), shift / (slope + ONE)], dtype=np.float32)
    return Lens(view, projection, inverse[3, :3].astype(np.float64), planes)


@compiled
def _set_frame(pose, frame, inverse):  # type: ignore[no-untyped-def]
    """Set a frame and its transposed inverse from x, y, z (metres) and a quaternion, with Bullet's arithmetic."""
    x, y, z, w = pose[3], pose[4], pose[5], pose[6]
    scale = 2.0 / (((x * x + y * y) + z * z) + w * w)
    xs, ys, zs = x * scale, y * scale, z * scale
    wx, wy, wz, xx, xy, xz, yy, yz, zz = w * xs, w * ys, w * zs, x * xs, x * ys, x * zs, y * ys, y * zs, z * zs
    frame[0, 0], frame[0, 1], frame[0, 2] = 1.0 - (yy + zz), xy - wz, xz + wy
    frame[1, 0], frame[1, 1], frame[1, 2] = xy + wz, 1.0 - (xx + zz), yz - wx
    frame[2, 0], frame[2, 1], frame[2, 2] = xz - wy, yz + wx, 1.0 - (xx + yy)
    for i in range(3):
        frame[i, 3], frame[3, i] = pose[i], ZERO
    frame[3, 3] = ONE
    _invert_transpose(frame, inverse)


@compiled
def put(body, first_frame, poses, stage):  # type: ignore[no-untyped-def]
    """Put a body in its place.

    Args:
        body: its number.
        first_frame: number of its first frame.
        poses: (frames, 7) x, y, z in metres and quaternion x, y, z, w of its frames in the world.
        stage: the words of the :class:`Stage` to change.
    """
    models, placed, _ = stage_of(stage)
    _put(body, first_frame, poses, models, placed)


@compiled
def put_each(bodies, first_frames, poses, stage):  # type: ignore[no-untyped-def]
    """Put bodies of one frame each in their places, see :func:`put`."""
    models, placed, _ = stage_of(stage)
    for number, body in enumerate(bodies):
        _put(body, first_frames[number], poses[number : number + 1], models, placed)


@compiled
def _put(body, first_frame, poses, models, placed):  # type: ignore[no-untyped-def]
    for number in range(len(poses)):
        _set_frame(poses[number], placed.frames[first_frame + number], placed.inverses[first_frame + number])
    first, last = models.first_part[body], models.first_part[body + 1]
    begin, end = models.first_vertex[first], models.first_vertex[last]
    world = np.empty((end - begin, 3), np.float32)
    for part in range(first, last):
        frame, start = placed.frames[models.frame[part]], models.first_vertex[part]
        for number in range(start, models.first_vertex[part + 1]):
            x, y, z = models.vertices[number, 0], models.vertices[number, 1], models.vertices[number, 2]
            for i in range(3):
                world[number - begin, i] = dot4(frame[i, 0], frame[i, 1], frame[i, 2], frame[i, 3], x, y, z, ONE)
        for face in range(models.first_triangle[part], models.first_triangle[part + 1]):
            _set_side(world, begin, models.corners[face], placed.sides[face])
    _set_ball(world, placed.balls[body])


@compiled
def _set_ball(points, ball):  # type: ignore[no-untyped-def]
    for i in range(3):
        low, high = np.inf, -np.inf
        for number in range(len(points)):
            low, high = min(low, np.float64(points[number, i])), max(high, np.float64(points[number, i]))
        ball[i] = (low + high) / 2
    greatest = 0.0
    for number in range(len(points)):
        square = 0.0
        for i in range(3):
            off = points[number, i] - ball[i]
            square += off * off
        greatest = max(greatest, square)
    ball[3] = np.sqrt(greatest) + 1e-3


@compiled
def _set_side(world, begin, corner, side):  # type: ignore[no-untyped-def]
    a, b, c = corner[0] - begin, corner[1] - begin, corner[2] - begin
    for i in range(3):
        side[i] = world[a, i]
    ux, uy, uz = world[b, 0] - side[0], world[b, 1] - side[1], world[b, 2] - side[2]
    vx, vy, vz = world[c, 0] - side[0], world[c, 1] - side[1], world[c, 2] - side[2]
    side[3], side[4], side[5] = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
