"""Draws one triangle with TinyRenderer's own arithmetic, so that pictures agree to the bit.

The order of operations and their precision are those of TinyRenderer in Bullet 3.25: single precision
for transforms and shading, double precision for barycentric coordinates and for which side a triangle
turns to the camera. ``tests/test_sight.py`` compares the two. Numba compiles these functions at their
first use and keeps the result on disk; it fuses no multiply and add unless told to. Touch ``placing.py`` and
``raster.py`` after a change here: Numba looks at the file of the calling function alone.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

Floats = NDArray[np.float32]

# "numpy": a division by zero gives infinity, as in TinyRenderer.
compiled = njit(cache=True, error_model="numpy")
_inlined = njit(cache=True, error_model="numpy", inline="always")

ZERO, ONE, TWO = np.float32(0), np.float32(1), np.float32(2)


class Lens(NamedTuple):
    """A camera at a pose.

    Attributes:
        world_to_camera: (4, 4).
        projection: (4, 4) from camera to clip coordinates.
        eye: (3,) its position in the world, metres.
        planes: (2,) distances of the near and the far plane, metres.
    """

    world_to_camera: Floats
    projection: Floats
    eye: NDArray[np.float64]
    planes: Floats


class Light(NamedTuple):
    """Where light comes from and how it is reflected.

    Attributes:
        direction: (3,) unit vector towards the light.
        coefficients: (4,) ambient, diffuse, specular, and the exponent of the specular term.
    """

    direction: Floats
    coefficients: Floats


class Canvas(NamedTuple):
    """What is drawn on, rows from the top; pixels that no body covers are left as they are.

    Attributes:
        home: (size, size) depth of the empty home, in [0, 1].
        raw: (size, size) TinyRenderer's own depth of what is drawn: minus infinity where nothing is.
        owner: (size, size) whose pixel it is.
        depth: (size, size) TinyRenderer's depth as PyBullet gives it, in [0, 1].
        colour: (size, size, 4) red, green, blue, alpha.
    """

    home: Floats
    raw: Floats
    owner: NDArray[np.int32]
    depth: Floats
    colour: NDArray[np.uint8]


def clean_canvas(size: int) -> Canvas:
    """Return a canvas for owners alone."""
    nothing = np.zeros((1, 1), np.float32)
    raw = np.full((size, size), -np.inf, np.float32)
    return Canvas(nothing, raw, np.full((size, size), -1, np.int32), nothing, np.zeros((1, 1, 4), np.uint8))


@_inlined
def dot4(a0, a1, a2, a3, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """Return a product of two vectors, summed from the last entry on."""
    return ((a3 * b3 + a2 * b2) + a1 * b1) + a0 * b0


@_inlined
def screen(x, w, half):  # type: ignore[no-untyped-def]
    """Return a coordinate in pixels of a point in clip coordinates."""
    return (half * w + half * x) / w


@_inlined
def _weights(s0, s1, s2, w0, w1, w2):  # type: ignore[no-untyped-def]
    """Return barycentric coordinates corrected for perspective."""
    b0, b1, b2 = s0 / w0, s1 / w1, s2 / w2
    total = (b0 + b1) + b2
    return b0 / total, b1 / total, b2 / total


@_inlined
def _barycentric(ax, ay, bx, by, cx, cy, uz, px, py):  # type: ignore[no-untyped-def]
    """Return a pixel's barycentric coordinates in a triangle of twice the area ``uz``; -1 first if it lies outside."""
    uy = (ax - px) * (cy - ay) - (cx - ax) * (ay - py)
    ux = (bx - ax) * (ay - py) - (ax - px) * (by - ay)
    if (uy != 0 and (uy < 0) != (uz < 0)) or (ux != 0 and (ux < 0) != (uz < 0)):
        return -1.0, 0.0, 0.0
    return 1.0 - (ux + uy) / uz, uy / uz, ux / uz


@compiled
def _shade(pixel, colour, normals, b0, b1, b2, light):  # type: ignore[no-untyped-def]
    """Set a pixel to ambient, diffuse and specular light on the interpolated normal."""
    x = (normals[2, 0] * b2 + normals[1, 0] * b1) + normals[0, 0] * b0
    y = (normals[2, 1] * b2 + normals[1, 1] * b1) + normals[0, 1] * b0
    z = (normals[2, 2] * b2 + normals[1, 2] * b1) + normals[0, 2] * b0
    scale = ONE / np.sqrt((x * x + y * y) + z * z)
    x, y, z = x * scale, y * scale, z * scale
    lx, ly, lz = light.direction[0], light.direction[1], light.direction[2]
    towards = (z * lz + y * ly) + x * lx
    twice = towards * TWO
    rx, ry, rz = x * twice - lx, y * twice - ly, z * twice - lz
    mirrored = rz * (ONE / np.sqrt((rx * rx + ry * ry) + rz * rz))
    ambient, diffuse, specular, exponent = light.coefficients
    reflected = diffuse * max(ZERO, towards) + specular * max(mirrored, ZERO) ** exponent
    for i in range(3):
        own = np.float32(colour[i])
        pixel[i] = min(int(ambient * own + reflected * own), 255)
    pixel[3] = 255


@compiled
def fill(points, pixels, whole, whole_pixels, clipped, colour, normals, owner, lens, light, canvas, shaded):  # type: ignore[no-untyped-def]
    """Draw one triangle where it is nearer than the home and than what is drawn already.

    Args:
        points: (3, 4) its corners in clip coordinates.
        pixels: (3, 2) its corners in pixels, x to the right, y upwards.
        whole: (3, 4) the triangle that it was cut from, if it was ``clipped``, whose normals count.
        whole_pixels: (3, 2) its corners in pixels.
        clipped: whether it was cut at the near plane.
        colour: (3,) bytes.
        normals: (3, 3) at the corners of the whole triangle, in the world.
        owner: value for ``canvas.owner``.
        lens: the camera.
        light: the light.
        canvas: what to draw on.
        shaded: whether depth and colour are wanted beside the owner.
    """
    size = canvas.home.shape[0]
    last = np.float32(size - 1)
    ax, ay, bx, by, cx, cy = pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1], pixels[2, 0], pixels[2, 1]
    left, right = np.ceil(max(ZERO, min(ax, bx, cx))), min(last, max(ax, bx, cx))
    low, high = np.ceil(max(ZERO, min(ay, by, cy))), min(last, max(ay, by, cy))
    if not (left <= right and low <= high):
        return
    x0, y0, x1, y1, x2, y2 = _doubles(ax, ay, bx, by, cx, cy)
    area = (x2 - x0) * (y1 - y0) - (x1 - x0) * (y2 - y0)
    if not abs(area) > 1e-2:
        return  # TinyRenderer leaves out slivers
    near, far = lens.planes[0], lens.planes[1]
    nearest = _depth(-min(points[0, 2], points[1, 2], points[2, 2]), near, far) - np.float32(1e-6)
    for px in range(int(left), int(right) + 1):
        first, final = _rows(x0, y0, x1, y1, x2, y2, float(px), low, high)
        for py in range(first, final + 1):
            row = size - 1 - py
            if canvas.home[row, px] <= nearest:
                continue
            s0, s1, s2 = _barycentric(x0, y0, x1, y1, x2, y2, area, np.float64(px), np.float64(py))
            if s0 < 0:
                continue
            b0, b1, b2 = _weights(s0, s1, s2, points[0, 3], points[1, 3], points[2, 3])
            raw = -((points[2, 2] * b2 + points[1, 2] * b1) + points[0, 2] * b0)
            if not clipped and (raw < -far or raw > near):
                continue
            if _replace(row, px, raw, owner, lens, canvas) and shaded:
                if clipped:
                    b0, b1, b2 = _weights_in(whole, whole_pixels, np.float64(px), np.float64(py))
                _shade(canvas.colour[row, px], colour, normals, np.float32(b0), np.float32(b1), np.float32(b2), light)


@_inlined
def _replace(row, column, raw, owner, lens, canvas):  # type: ignore[no-untyped-def]
    """Let an owner have a pixel if it is nearer there than what is drawn and than the home; return whether it is."""
    if canvas.raw[row, column] > raw:
        return False
    depth = _depth(np.float32(raw), lens.planes[0], lens.planes[1])
    if not depth < canvas.home[row, column]:
        return False  # at equal depth the home was there first
    canvas.raw[row, column] = np.float32(raw)
    canvas.owner[row, column] = owner
    if canvas.depth.shape[0] > 1:
        canvas.depth[row, column] = depth
    return True


@compiled
def _rows(x0, y0, x1, y1, x2, y2, px, low, high):  # type: ignore[no-untyped-def]
    """Return the first and last row from ``low`` to ``high`` in which a column of pixels can meet a triangle."""
    least, greatest = np.inf, -np.inf
    for ax, ay, bx, by in ((x0, y0, x1, y1), (x1, y1, x2, y2), (x2, y2, x0, y0)):
        if min(ax, bx) <= px <= max(ax, bx):
            y = ay + (px - ax) * (by - ay) / (bx - ax) if ax != bx else ay
            least, greatest = min(least, y), max(greatest, y)
    # Rounding moves an edge by far less than this; rows that are tested in vain do no harm.
    margin = 1e-3 + 1e-9 * (abs(y0) + abs(y1) + abs(y2))
    first, final = max(np.float64(low), np.ceil(least - margin)), min(np.float64(high), greatest + margin)
    return int(first), int(final)


@_inlined
def _doubles(a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    return np.float64(a), np.float64(b), np.float64(c), np.float64(d), np.float64(e), np.float64(f)


@_inlined
def _depth(raw, near, far):  # type: ignore[no-untyped-def]
    """Return the depth in [0, 1] that PyBullet makes of TinyRenderer's own."""
    z = -raw
    return np.float32(np.float64(far * (near + z)) / ((2.0 * far * near + np.float64(far * z)) - np.float64(near * z)))


@compiled
def _weights_in(points, pixels, px, py):  # type: ignore[no-untyped-def]
    """Return a pixel's weights in a triangle that lies partly behind the camera."""
    ax, ay, bx, by, cx, cy = _doubles(
        pixels[0, 0], pixels[0, 1], pixels[1, 0], pixels[1, 1], pixels[2, 0], pixels[2, 1]
    )
    ux = (bx - ax) * (ay - py) - (ax - px) * (by - ay)
    uy = (ax - px) * (cy - ay) - (cx - ax) * (ay - py)
    uz = (cx - ax) * (by - ay) - (bx - ax) * (cy - ay)
    s0, s1, s2 = -1.0, 1.0, 1.0
    if abs(uz) > 1e-2:
        s0, s1, s2 = 1.0 - (ux + uy) / uz, uy / uz, ux / uz
    return _weights(s0, s1, s2, points[0, 3], points[1, 3], points[2, 3])


@compiled
def _clip(points, out):  # type: ignore[no-untyped-def]
    """Cut a triangle (3, 4) at the near plane; return the number of corners left, set in ``out`` (6, 4)."""
    count = 0
    for edge in range(3):
        a, b = points[edge], points[(edge + 1) % 3]
        a_in, b_in = a[3] > 0 and a[2] > -a[3], b[3] > 0 and b[2] > -b[3]
        if not (a_in or b_in):
            continue
        out[count], out[count + 1] = a, b
        if not (a_in and b_in):
            da, db = a[2] + a[3], b[2] + b[3]
            factor = np.float32(1.0 / np.float64(db - da))
            cut = count + 1 if a_in else count
            for i in range(4):
                out[cut, i] = (a[i] * db - b[i] * da) * factor
        count += 2
    return count


@compiled
def fill_clipped(points, pixels, colour, normals, owner, lens, light, canvas, shaded):  # type: ignore[no-untyped-def]
    """Draw what is left of a triangle that reaches behind the camera; see :func:`fill`."""
    half = np.float32(canvas.home.shape[0]) / TWO
    corners, part, part_pixels = (
        np.empty((6, 4), np.float32),
        np.empty((3, 4), np.float32),
        np.empty((3, 2), np.float32),
    )
    count = _clip(points, corners)
    for i in range(1, count - 1):
        for k, corner in enumerate((0, i, i + 1)):
            part[k] = corners[corner]
            for axis in range(2):
                part_pixels[k, axis] = screen(part[k, axis], part[k, 3], half)
        fill(part, part_pixels, points, pixels, True, colour, normals, owner, lens, light, canvas, shaded)
