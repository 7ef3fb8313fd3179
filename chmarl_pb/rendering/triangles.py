"""Draws one triangle with TinyRenderer's own arithmetic, so that pictures agree to the bit.

The order of operations and their precision are those of TinyRenderer in Bullet 3.25: single precision
for transforms and shading, double precision for barycentric coordinates and for which side a triangle
turns to the camera. ``tests/rendering/`` compares the two. Numba fuses no multiply and add unless told to.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled

Floats = NDArray[np.float32]

SURELY = 1.001  # times as near: far more than rounding can matter
_MANY = 7  # pixels of a row from which on it pays to work out all of them at once
_LARGE, CLOSE = 1e4, 0.05  # pixels and metres beyond which rounding may matter more
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


@compiled
def dot4(a0, a1, a2, a3, b0, b1, b2, b3):  # type: ignore[no-untyped-def]
    """Return a product of two vectors, summed from the last entry on."""
    return ((a3 * b3 + a2 * b2) + a1 * b1) + a0 * b0


@compiled
def screen(x, w, half):  # type: ignore[no-untyped-def]
    """Return a coordinate in pixels of a point in clip coordinates."""
    return (half * w + half * x) / w


@compiled
def _barycentric(a, b, c, area, px, py):  # type: ignore[no-untyped-def]
    """Return a pixel's barycentric coordinates in a triangle of twice the area, and whether it lies outside."""
    ax, ay, bx, by, cx, cy = doubles(a[0], a[1], b[0], b[1], c[0], c[1])
    uy = (ax - px) * (cy - ay) - (cx - ax) * (ay - py)
    ux = (bx - ax) * (ay - py) - (ax - px) * (by - ay)
    s0 = 1.0 - (ux + uy) / area
    outside = (uy != 0 and (uy < 0) != (area < 0)) or (ux != 0 and (ux < 0) != (area < 0)) or s0 < 0
    return s0, uy / area, ux / area, outside


@compiled
def _interpolate(a, b, c, s0, s1, s2):  # type: ignore[no-untyped-def]
    """Return TinyRenderer's depth, and the nearness, at barycentric coordinates in a triangle."""
    b0, b1, b2 = s0 / a[3], s1 / b[3], s2 / c[3]  # corrected for perspective
    total = (b0 + b1) + b2
    return -((c[2] * (b2 / total) + b[2] * (b1 / total)) + a[2] * (b0 / total)), total


@compiled
def _depth_at(a, b, c, area, px, py):  # type: ignore[no-untyped-def]
    """Return depth and nearness of a triangle at a pixel; nearness is -1 if it lies outside."""
    s0, s1, s2, outside = _barycentric(a, b, c, area, px, py)
    return (0.0, -1.0) if outside else _interpolate(a, b, c, s0, s1, s2)


@compiled
def _fill(a, b, c, area, first, last, py, depths, nears):  # type: ignore[no-untyped-def]
    """Set depth and nearness of a triangle at some pixels of a row; nearness is -1 where they lie outside.

    Those are worked out like all others, so that the processor takes eight at once: it would not, were ``depths`` and
    ``nears`` rows of one array.
    """
    for px in range(first, last + 1):
        s0, s1, s2, outside = _barycentric(a, b, c, area, np.float64(np.int32(px)), py)
        depths[px], total = _interpolate(a, b, c, s0, s1, s2)
        nears[px] = -1.0 if outside else total


@compiled
def cover(a, b, c, clipped, face, near, far, home, raw, nearness, faces, depths, nears):  # type: ignore[no-untyped-def]
    """Take the pixels where a triangle is nearer than the empty home and than what is drawn already.

    Few arrays are passed, one by one: Numba counts a reference to each at every call.

    Args:
        a: first corner: x to the right and y upwards in pixels, z and w in clip coordinates.
        b: second corner.
        c: third corner.
        clipped: whether it was cut at the near plane.
        face: number of the triangle.
        near: distance of the near plane, metres.
        far: distance of the far plane, metres.
        home: (size, size) depth of the empty home, in [0, 1].
        raw: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        nearness: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        faces: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        depths: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        nears: as in :class:`chmarl_pb.rendering.canvas.Canvas`.

    Returns:
        How many of the pixels were clean.
    """
    size, clean = home.shape[0], 0
    last = np.float32(size - 1)
    left, right = np.ceil(max(ZERO, min(a[0], b[0], c[0]))), min(last, max(a[0], b[0], c[0]))
    low, high = np.ceil(max(ZERO, min(a[1], b[1], c[1]))), min(last, max(a[1], b[1], c[1]))
    x0, y0, x1, y1, x2, y2 = doubles(a[0], a[1], b[0], b[1], c[0], c[1])
    area = (x2 - x0) * (y1 - y0) - (x1 - x0) * (y2 - y0)
    if not (left <= right and low <= high and abs(area) > 1e-2):  # TinyRenderer leaves out slivers
        return 0
    nearest = depth_of(-min(a[2], b[2], c[2]), near, far) - np.float32(1e-6)  # but for rounding
    deepest = depth_of(-max(a[2], b[2], c[2]), near, far) + np.float32(1e-6)
    within = min(a[2], b[2], c[2]) > 0 and max(a[2], b[2], c[2]) < np.float32(0.999) * far  # surely of both planes
    start, across, upwards = _plane(a, b, c, area, clipped)
    slope0, slope1, slope2 = _slope(x0, y0, x1, y1), _slope(x1, y1, x2, y2), _slope(x2, y2, x0, y0)
    # Rounding moves an edge by far less than this; columns that are tested in vain do no harm.
    margin = 1e-3 + 1e-9 * (abs(x0) + abs(x1) + abs(x2))
    for py in range(int(low), int(high) + 1):
        row = size - 1 - py
        least, greatest = _meet(x0, y0, y1, slope0, float(py), np.inf, -np.inf)
        least, greatest = _meet(x1, y1, y2, slope1, float(py), least, greatest)
        least, greatest = _meet(x2, y2, y0, slope2, float(py), least, greatest)
        first, final = max(np.float64(left), np.ceil(least - margin)), min(np.float64(right), greatest + margin)
        level = start + upwards * py
        begin, end = int(first), int(final)
        while begin <= end and (home[row, begin] <= nearest or level + across * begin < nearness[row, begin]):
            begin += 1
        while begin <= end and (home[row, end] <= nearest or level + across * end < nearness[row, end]):
            end -= 1
        many = end - begin + 1 >= _MANY
        if many:
            _fill(a, b, c, area, begin, end, float(py), depths, nears)
        for px in range(begin, end + 1):
            own, total = (depths[px], nears[px]) if many else _depth_at(a, b, c, area, np.float64(px), float(py))
            if total < 0 or (faces[row, px] >= 0 and _is_hidden(own, face, raw[row, px], faces[row, px])):
                continue
            if not (clipped or within) and (own < -far or own > near):
                continue
            # At equal depth the home was there first.
            if (within and deepest < home[row, px]) or depth_of(np.float32(own), near, far) < home[row, px]:
                clean += faces[row, px] < 0
                raw[row, px], nearness[row, px], faces[row, px] = own, total, face
    return clean


@compiled
def _plane(a, b, c, area, clipped):  # type: ignore[no-untyped-def]
    """Return a plane over the picture that surely is not below the nearness of a triangle: at pixel (0, 0), and slopes.

    Nearness is linear in the picture. What is nearer than the plane by ``SURELY`` hides the triangle, however sums are
    rounded. Triangles whose sums are of large terms, and those that reach behind the camera, have a plane of infinity.
    """
    large = max(abs(a[0]), abs(b[0]), abs(c[0]), abs(a[1]), abs(b[1]), abs(c[1])) > _LARGE
    if clipped or large or abs(area) < 1 or min(a[3], b[3], c[3]) < CLOSE:
        return np.inf, 0.0, 0.0
    x0, y0, x1, y1, x2, y2 = doubles(a[0], a[1], b[0], b[1], c[0], c[1])
    own = 1.0 / np.float64(a[3])
    second, third = (1.0 / np.float64(b[3]) - own) / area, (1.0 / np.float64(c[3]) - own) / area
    across, upwards = third * (y1 - y0) - second * (y2 - y0), second * (x2 - x0) - third * (x1 - x0)
    start = own - across * x0 - upwards * y0
    return start * SURELY, across * SURELY, upwards * SURELY


@compiled
def _is_hidden(own, face, raw, other):  # type: ignore[no-untyped-def]
    """Return whether a triangle does not show at a pixel where another one is drawn, whichever was drawn first.

    TinyRenderer draws triangles in their order, and a later one covers those whose depths, rounded to single precision,
    are not nearer than its own.
    """
    kept, new = np.float32(raw), np.float32(own)
    if kept != new:
        return kept > new
    covers, covered = own >= new, raw >= kept
    if covers and covered:
        return face < other
    return covered or (not covers and face > other)


@compiled
def _slope(ax, ay, bx, by):  # type: ignore[no-untyped-def]
    """Return by how much an edge moves to the right from one row of pixels to the next one above it."""
    return (bx - ax) / (by - ay) if ay != by else 0.0


@compiled
def _meet(ax, ay, by, slope, py, least, greatest):  # type: ignore[no-untyped-def]
    """Return the least and the greatest column with that in which an edge crosses a row of pixels, if it does."""
    if min(ay, by) <= py <= max(ay, by):
        x = ax + (py - ay) * slope
        least, greatest = min(least, x), max(greatest, x)
    return least, greatest


@compiled
def doubles(a, b, c, d, e, f):  # type: ignore[no-untyped-def]
    """Return six numbers in double precision."""
    return np.float64(a), np.float64(b), np.float64(c), np.float64(d), np.float64(e), np.float64(f)


@compiled
def depth_of(raw, near, far):  # type: ignore[no-untyped-def]
    """Return the depth in [0, 1] that PyBullet makes of TinyRenderer's own."""
    z = -raw
    whole = (np.float64(2) * far * near + np.float64(far * z)) - np.float64(near * z)
    return np.float32(np.float64(far * (near + z)) / whole)


@compiled
def corner_of(row):  # type: ignore[no-untyped-def]
    """Return a corner as :func:`cover` takes it from a row of the scratch."""
    return row[0], row[1], row[2], row[3]


@compiled
def cover_clipped(rows, face, near, far, home, raw, nearness, faces, depths, nears):  # type: ignore[no-untyped-def]
    """Take the pixels of what is left of a triangle that reaches behind the camera; see :func:`cover`.

    Args:
        rows: (3, 6) x and y in pixels, z and w, x and y in clip coordinates of its corners.
        face: number of the triangle.
        near: distance of the near plane, metres.
        far: distance of the far plane, metres.
        home: depth of the empty home.
        raw: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        nearness: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        faces: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        depths: as in :class:`chmarl_pb.rendering.canvas.Canvas`.
        nears: as in :class:`chmarl_pb.rendering.canvas.Canvas`.

    Returns:
        How many of the pixels were clean.
    """
    clean, half = 0, np.float32(home.shape[0]) / TWO
    points = np.empty((6, 4), np.float32)
    count = _clip(rows[:, 4], rows[:, 5], rows[:, 2], rows[:, 3], points)
    for i in range(count):
        points[i, 0], points[i, 1] = screen(points[i, 0], points[i, 3], half), screen(points[i, 1], points[i, 3], half)
    for i in range(1, count - 1):
        a, b, c = corner_of(points[0]), corner_of(points[i]), corner_of(points[i + 1])
        clean += cover(a, b, c, count > 0, face, near, far, home, raw, nearness, faces, depths, nears)
    return clean


@compiled
def _clip(x, y, z, w, out):  # type: ignore[no-untyped-def]
    """Cut a triangle in clip coordinates at the near plane; return the number of corners left, set in ``out``."""
    count = 0
    for a in range(3):
        b = (a + 1) % 3
        a_in, b_in = w[a] > 0 and z[a] > -w[a], w[b] > 0 and z[b] > -w[b]
        if not (a_in or b_in):
            continue
        for place, corner in ((count, a), (count + 1, b)):
            out[place, 0], out[place, 1], out[place, 2], out[place, 3] = x[corner], y[corner], z[corner], w[corner]
        if not (a_in and b_in):
            da, db = z[a] + w[a], z[b] + w[b]
            factor = np.float32(1.0 / np.float64(db - da))
            cut = count + 1 if a_in else count
            for i, v in enumerate((x, y, z, w)):
                out[cut, i] = (v[a] * db - v[b] * da) * factor
        count += 2
    return count
