"""Convex solids: the collision geometry of a home as polygons, heights and half-spaces.

All functions are vectorised NumPy, or compiled, on world coordinates (metres, z up). A mesh counts as its convex
hull, which is also what PyBullet makes of a collision mesh.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from chmarl_pb.compiled import compiled

Points = NDArray[np.floating]

MOST_CORNERS = 256  # of a convex piece: what is derived from a home goes through all corners of all pieces

_THIN = 2e-3  # metres between a level face and its corners
_FLAT = 0.999  # a face whose normal has this z-component or more counts as level (2.6 degrees)


@dataclass(frozen=True, eq=False)
class Solid:
    """One convex piece of collision geometry in the world frame.

    Attributes:
        polygon: (k, 2) counter-clockwise outline of its projection on the floor.
        bottom, top: lowest and highest z.
        planes: (m, 4) outward half-spaces ``n . x + d <= 0``.
        facet: (j, 2) counter-clockwise outline of its highest level face, on which things can stand; None if its top is
            an edge, a corner or a slope.
    """

    polygon: Points
    bottom: float
    top: float
    planes: Points
    facet: Points | None = None

    @cached_property
    def low(self) -> Points:
        """Lower corner (2,) of the outline's bounding box."""
        corner: Points = self.polygon.min(axis=0)
        return corner

    @cached_property
    def high(self) -> Points:
        """Upper corner (2,) of the outline's bounding box."""
        corner: Points = self.polygon.max(axis=0)
        return corner

    @cached_property
    def sides(self) -> "HalfPlanes":
        """Its outline as half-planes: surfaces ask many times."""
        return half_planes(self.polygon)

    def spans(self, low: float, high: float) -> bool:
        """Whether it has a part with a height between ``low`` and ``high``."""
        return self.top > low and self.bottom < high


def bounds(solids: Sequence[Solid]) -> tuple[Points, Points]:
    """Return the lower and the upper corner (3,) of the level box around solids."""
    low = np.min([(*solid.low, solid.bottom) for solid in solids], axis=0)
    high = np.max([(*solid.high, solid.top) for solid in solids], axis=0)
    return low, high


def solid_from_vertices(vertices: Points) -> Solid:
    """Return the convex hull of (n, 3) points as a solid.

    Raises:
        ValueError: the points span no volume.
    """
    try:
        hull = ConvexHull(vertices)
    except Exception as error:  # scipy raises its own QhullError, which is not exported everywhere
        raise ValueError("its collision geometry spans no volume") from error
    if len(hull.vertices) > MOST_CORNERS:
        raise ValueError(f"its hull has {len(hull.vertices):,} corners, at most {MOST_CORNERS} are read; simplify it")
    outline = vertices[:, :2]
    polygon = outline[ConvexHull(outline).vertices]
    rows = np.round(hull.equations, 9) + 0.0  # without negative zeros
    planes = np.array(sorted(set(map(tuple, rows.tolist()))))  # np.unique is many times as slow on so few
    bottom, top = float(vertices[:, 2].min()), float(vertices[:, 2].max())
    return Solid(polygon, bottom, top, planes, _facet(vertices[hull.vertices], planes, top, polygon))


def prism(corners: list[list[float]], bottom: float, top: float) -> Solid:
    """Return an upright prism, many times as fast as from its vertices.

    Args:
        corners: (k, 2) of a convex outline, counter-clockwise.
        bottom: its lowest z.
        top: its highest z.
    """
    first = corners.index(min(corners))
    corners = corners[first:] + corners[:first]
    rows = {(0.0, 0.0, 1.0, _rounded(-top)), (0.0, 0.0, -1.0, _rounded(bottom))}
    for (x, y), (x1, y1) in zip(corners, corners[1:] + corners[:1], strict=True):
        length = math.hypot(x1 - x, y1 - y)
        across, along = (y1 - y) / length, (x - x1) / length
        rows.add((_rounded(across), _rounded(along), 0.0, _rounded(-(across * x + along * y))))
    polygon = np.array(corners)
    return Solid(polygon, bottom, top, np.array(sorted(rows)), polygon)


def _rounded(number: float) -> float:
    """Return what ``np.round`` makes of a number with 9 decimals, without negative zeros."""
    return round(number * 1e9) / 1e9


def _facet(corners: Points, planes: Points, top: float, polygon: Points) -> Points | None:
    """Return the outline of the highest level face of a hull; that of the hull itself if its sides are upright."""
    level = planes[planes[:, 2] > _FLAT]
    if not len(level):
        return None
    face = level[level[:, 3].argmin()]
    if abs(-face[3] - top) > _THIN + 1e-5 * abs(top):
        return None
    on = corners[np.abs(corners @ face[:3] + face[3]) < _THIN][:, :2]
    if (np.abs(on[:, None] - polygon).max(axis=2).min(axis=0, initial=np.inf) < 1e-9).all():
        return polygon
    try:
        return np.asarray(on[ConvexHull(on).vertices])
    except Exception:  # scipy raises its own QhullError: an edge or a corner
        return None


def inside(polygon: Points, points: Points, margin: float = 0.0) -> NDArray[np.bool_]:
    """Return whether points (..., 2) lie in a convex polygon, at most ``margin`` outside its edges."""
    return within(half_planes(polygon), points, margin)


HalfPlanes = tuple[Points, NDArray[np.floating]]
"""Outward normals (k, 2) of a convex polygon's edges, and how far from the origin along them the edges lie (k,)."""


def half_planes(polygon: Points) -> HalfPlanes:
    """Return a convex polygon (k, 2), counter-clockwise, as half-planes."""
    normals = _normals(polygon)
    normals /= np.sqrt((normals * normals).sum(axis=1, keepdims=True))
    return normals, np.einsum("kd,kd->k", normals, polygon)


def _normals(polygon: Points) -> Points:
    """Return the outward normals of a convex polygon's edges, each as long as the edge."""
    normals = np.empty(polygon.shape)
    normals[:-1, 0], normals[-1, 0] = polygon[1:, 1] - polygon[:-1, 1], polygon[0, 1] - polygon[-1, 1]
    normals[:-1, 1], normals[-1, 1] = polygon[:-1, 0] - polygon[1:, 0], polygon[-1, 0] - polygon[0, 0]
    return normals


def within(sides: HalfPlanes, points: Points, margin: float = 0.0) -> NDArray[np.bool_]:
    """Return whether points (..., 2) lie in a convex polygon of these sides, at most ``margin`` outside its edges."""
    normals, offsets = sides
    beyond = points.reshape(-1, 2) @ normals.T - offsets
    return np.asarray((beyond <= margin + 1e-9).all(axis=-1).reshape(points.shape[:-1]))


class Sides(NamedTuple):
    """The half-planes whose common part is a convex polygon, of many polygons.

    Attributes:
        normals: (polygons, sides, 2) pointing out.
        offsets: (polygons, sides) of the lines along the normals.
    """

    normals: Points
    offsets: Points


class Outlines:
    """Many convex polygons at once, as half-planes, for tests of lines of sight.

    Attributes:
        sides: of the polygons.
    """

    def __init__(self, polygons: Sequence[Points]):
        """Stack polygons (k, 2), counter-clockwise; shorter ones repeat their last edge."""
        most = max((len(polygon) for polygon in polygons), default=3)
        shape = (len(polygons), most)
        self.sides = Sides(np.zeros((*shape, 2)), np.zeros(shape))
        for row, polygon in enumerate(polygons):
            normals = _normals(polygon)
            offsets = (normals * polygon).sum(axis=1)
            order = np.minimum(np.arange(most), len(polygon) - 1)
            self.sides.normals[row], self.sides.offsets[row] = normals[order], offsets[order]

    def crossed(self, starts: Points, ends: Points, among: NDArray[np.int_] | None = None) -> NDArray[np.bool_]:
        """Return (n, polygons) which polygons each segment crosses, by clipping (Cyrus and Beck 1978).

        Args:
            starts: (n, 2) first ends of the segments.
            ends: (n, 2) their last ends.
            among: numbers of the polygons to test; by default all.
        """
        if among is None:
            among = np.arange(len(self.sides.offsets))
        starts, ends = np.ascontiguousarray(starts), np.ascontiguousarray(ends)
        found = np.empty((len(starts), len(among)), np.bool_)
        _find_crossed(self.sides, starts, ends, among, found)
        return found


@compiled
def _find_crossed(sides, starts, ends, among, found):  # type: ignore[no-untyped-def]
    """Set ``found`` (n, m): which of some polygons each segment crosses."""
    for row in range(len(starts)):
        for column in range(len(among)):
            found[row, column] = crosses(
                sides, among[column], starts[row, 0], starts[row, 1], ends[row, 0], ends[row, 1]
            )


@compiled
def crosses(sides, polygon, start_x, start_y, end_x, end_y):  # type: ignore[no-untyped-def]
    """Return whether a segment runs in a polygon from its last entry into a half-plane to its first exit."""
    entry, leave = 0.0, 1.0
    for side in range(sides.offsets.shape[1]):
        x, y, offset = sides.normals[polygon, side, 0], sides.normals[polygon, side, 1], sides.offsets[polygon, side]
        before, after = start_x * x + start_y * y - offset, end_x * x + end_y * y - offset
        if before > 0:
            entry = np.inf if after > 0 else max(entry, before / (before - after))
        elif after > 0:
            leave = min(leave, before / (before - after))
        if entry > leave:
            break
    return entry <= leave


def segments_hit(polygon: Points, starts: Points, ends: Points, radius: float) -> NDArray[np.bool_]:
    """Return whether a disc swept along each segment touches a convex polygon.

    Args:
        polygon: (k, 2) counter-clockwise outline; or (k, n, 2), an outline of its own for each segment.
        starts: (n, 2) first ends of the segments.
        ends: (n, 2) their last ends; a segment may be a point.
        radius: of the disc, metres.
    """
    corners = polygon.reshape(len(polygon), -1, 2)
    following = np.roll(corners, -1, axis=0)
    near = (_segment_distance(corners, following, starts, ends) < radius).any(axis=0)
    return near | _left_of_all(corners, following, starts) | _left_of_all(corners, following, ends)


def apart(polygon: Points, starts: Points, ends: Points, distance: float) -> NDArray[np.bool_]:
    """Return which segments (n, 2) lie beyond an edge of their outline (k, n, 2) and surely farther than a distance."""
    edges = np.roll(polygon, -1, axis=0) - polygon
    least = (distance + 1e-9) * np.hypot(edges[..., 0], edges[..., 1])
    beyond = np.ones(edges.shape[:2], dtype=bool)
    for ends_of_segments in (starts, ends):
        away = ends_of_segments - polygon
        beyond &= edges[..., 1] * away[..., 0] - edges[..., 0] * away[..., 1] > least
    return np.asarray(beyond.any(axis=0))


def _left_of_all(a: Points, b: Points, points: Points) -> NDArray[np.bool_]:
    """Return whether points (n, 2) lie left of, or on, all edges a-b (k, n, 2): inside of their outline."""
    edges, away = b - a, points - a
    return np.asarray((edges[..., 0] * away[..., 1] - edges[..., 1] * away[..., 0] >= 0).all(axis=0))


def _segment_distance(a: Points, b: Points, starts: Points, ends: Points) -> NDArray[np.float64]:
    """Return the distance between segments a-b and start-end, broadcast against each other."""
    d, e = b - a, ends - starts
    cross = d[..., 0] * e[..., 1] - d[..., 1] * e[..., 0]
    offset = starts - a
    with np.errstate(divide="ignore", invalid="ignore"):
        t = (offset[..., 0] * e[..., 1] - offset[..., 1] * e[..., 0]) / cross
        u = (offset[..., 0] * d[..., 1] - offset[..., 1] * d[..., 0]) / cross
    crossing = (np.abs(cross) > 1e-12) & (t >= 0) & (t <= 1) & (u >= 0) & (u <= 1)
    nearest = np.minimum.reduce(
        [
            _point_distance(starts, a, b),
            _point_distance(ends, a, b),
            _point_distance(a, starts, ends),
            _point_distance(b, starts, ends),
        ]
    )
    return np.where(crossing, 0.0, nearest)


def _point_distance(points: Points, starts: Points, ends: Points) -> NDArray[np.float64]:
    """Return the distance between points and segments, broadcast against each other."""
    along = ends - starts
    away = points - starts
    length = np.maximum(along[..., 0] ** 2 + along[..., 1] ** 2, 1e-18)
    t = np.clip((away[..., 0] * along[..., 0] + away[..., 1] * along[..., 1]) / length, 0.0, 1.0)
    return np.hypot(away[..., 0] - t * along[..., 0], away[..., 1] - t * along[..., 1])


def overlap(one: Points, other: Points) -> float:
    """Return how far one convex polygon has to be moved to be clear of another, by the normals of their edges."""
    least = np.inf
    for polygon in (one, other):
        edges = np.roll(polygon, -1, axis=0) - polygon
        normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
        normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
        a, b = one @ normals.T, other @ normals.T
        depth = np.minimum(a.max(axis=0), b.max(axis=0)) - np.maximum(a.min(axis=0), b.min(axis=0))
        least = min(least, float(depth.min()))
    return least
