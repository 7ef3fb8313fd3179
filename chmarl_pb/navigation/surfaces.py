"""Where things can stand: the level tops of receptacles, as grids of free cells.

A surface is derived from collision geometry: every level top of a receptacle's solids, less what
other solids of the home cover, with the free height above each cell.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.rooms import Thing
from chmarl_pb.homes.solids import Points, Solid, half_planes, within
from chmarl_pb.navigation.reach import REACH

CELL = 0.05  # metres
#: Cells of all surfaces of a home: 100 m2 of tops. The benchmark's homes have up to 6,600.
MOST_CELLS = 40_000
_HEADROOM = 0.12  # metres: less free height than this is no surface
_TALLEST = 1.0  # metres: free heights are counted up to here
_SAME_LEVEL = 0.004  # metres between tops that make one surface
_NARROW = 5  # cells: parts of a top less wide than this (an armrest, the back of a sofa) are no surface
_GAP = 0.02  # metres left free around and above a placed object


@dataclass(frozen=True, eq=False)
class Surface:
    """One level surface of a receptacle, as a grid of cells in the receptacle's own axes.

    Attributes:
        receptacle: name of the thing.
        height: z of the surface.
        yaw: of the grid's axes in the world, radians.
        points: (rows, columns, 2) world x, y of the cells' centres.
        free: (rows, columns) free height above each cell in metres, 0 where there is no surface.
        covered: whether a part of the same receptacle lies above it, as in a bookshelf.
    """

    receptacle: str
    height: float
    yaw: float
    points: Points
    free: Points
    covered: bool
    _fits: dict[tuple[int, int, int], NDArray[np.int64]] = field(default_factory=dict)

    def fits(self, size: tuple[float, float, float]) -> NDArray[np.int64]:
        """Return the cells (n, 2) where a box of size x, y, z along the grid's axes can be centred."""
        rows, columns = (int(np.ceil((extent + 2 * _GAP) / CELL - 1e-9)) | 1 for extent in size[:2])
        key = (rows, columns, int(np.ceil((size[2] + _GAP) * 1000)))
        if key not in self._fits:
            room = _rectangles(self.free >= key[2] / 1000, rows, columns)
            self._fits[key] = np.argwhere(room) + np.array([rows // 2, columns // 2])
        return self._fits[key]


def find_surfaces(home: Home) -> tuple[Surface, ...]:
    """Return every surface of the home's receptacles within the humanoid's reach in height.

    Raises:
        HomeError: they are larger than a home can have.
    """
    grids = _grids(home)
    lows = np.column_stack([[solid.low for solid in home.solids], [solid.bottom for solid in home.solids]])
    highs = np.column_stack([[solid.high for solid in home.solids], [solid.top for solid in home.solids]])
    surfaces = [_surface(home, *grid, lows, highs) for grid in grids]
    return tuple(surface for surface in surfaces if (surface.free > 0).any())


def _grids(home: Home) -> list[tuple[Thing, float, list[Solid], float, list[Points]]]:
    """Return each receptacle with each height of its tops, the solids that have it, and the grid over them.

    Raises:
        HomeError: the grids are larger than those of a home can be.
    """
    grids, cells = [], 0
    for thing, height, tops in _tops(home):
        yaw, ticks = _grid(thing, tops)
        cells += ticks[0].size * ticks[1].size
        if cells > MOST_CELLS:
            raise HomeError(
                f"{home.path}: link {thing.name!r}: the tops of all receptacles have more than "
                f"{MOST_CELLS * CELL**2:.0f} m2; make them smaller"
            )
        grids.append((thing, height, tops, yaw, ticks))
    return grids


def _tops(home: Home) -> Iterator[tuple[Thing, float, list[Solid]]]:
    """Yield each receptacle with each height of its level tops within reach, and the solids that have it."""
    for thing in home.receptacles.values():
        level = [solid for solid in thing.solids if solid.facet is not None]
        for height in _levels(level):
            if REACH.height[0] <= height <= REACH.height[1]:
                yield thing, height, [solid for solid in level if abs(solid.top - height) <= _SAME_LEVEL]


def _levels(solids: list[Solid]) -> list[float]:
    """Return the distinct heights of tops, lowest first; close ones count as the highest of them."""
    levels: list[float] = []
    for top in sorted(solid.top for solid in solids):
        if levels and top - levels[-1] <= _SAME_LEVEL:
            levels[-1] = top
        else:
            levels.append(top)
    return levels


def _grid(thing: Thing, tops: list[Solid]) -> tuple[float, list[Points]]:
    """Return the yaw of a grid over some tops of a thing, and where its cells' centres are along both its axes."""
    yaw = math.atan2(thing.frame[1, 0], thing.frame[0, 0])
    corners = np.concatenate([solid.facet for solid in tops if solid.facet is not None]) @ _axes(yaw)
    return yaw, [_ticks(a, b) for a, b in zip(corners.min(axis=0), corners.max(axis=0), strict=True)]


@lru_cache(maxsize=64)
def _axes(yaw: float) -> Points:
    """Return the axes of a grid as columns; most receptacles have one of four yaws."""
    return np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])


def _surface(
    home: Home, thing: Thing, height: float, tops: list[Solid], yaw: float, ticks: list[Points], lows: Points,
    highs: Points,
) -> Surface:  # fmt: skip
    """Return the surface that some tops of a thing make, on a grid; lows and highs (n, 3) bound the home's solids."""
    grid = np.empty((len(ticks[0]), len(ticks[1]), 2))
    grid[..., 0], grid[..., 1] = ticks[0][:, None], ticks[1]
    points = grid @ _axes(yaw).T
    free = np.zeros(grid.shape[:2])
    for solid in tops:
        assert solid.facet is not None
        sides = solid.sides if solid.facet is solid.polygon else half_planes(solid.facet)
        free[within(sides, points, 1e-3)] = _TALLEST
    low = np.array([*points.min(axis=(0, 1)) - CELL, height + 2 * _SAME_LEVEL])
    high = np.array([*points.max(axis=(0, 1)) + CELL, height + _TALLEST])
    for number in np.flatnonzero(((low < highs) & (high > lows)).all(axis=1)):
        solid = home.solids[number]
        under = within(solid.sides, points, margin=CELL / 2)
        np.minimum(free, max(solid.bottom - height, 0.0), out=free, where=under)
    free[free < _HEADROOM] = 0.0
    free[~_wide_parts(free > 0)] = 0.0
    used = points[free > 0]
    covered = any(solid.bottom > height + _HEADROOM and within(solid.sides, used).any() for solid in thing.solids)
    return Surface(thing.name, height, yaw, points, free, covered)


def _wide_parts(cells: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the cells that lie in a square of ``_NARROW`` cells a side, all of which are true."""
    corners = _rectangles(cells, _NARROW, _NARROW)
    rows, columns = corners.shape
    strips, squares = np.zeros((len(cells), columns), dtype=bool), np.zeros(cells.shape, dtype=bool)
    for shift in range(_NARROW if corners.size else 0):
        strips[shift : shift + rows] |= corners
    for shift in range(_NARROW if corners.size else 0):
        squares[:, shift : shift + columns] |= strips
    return squares


def _rectangles(cells: NDArray[np.bool_], rows: int, columns: int) -> NDArray[np.bool_]:
    """Return at which cells a rectangle of so many cells begins, all of which are true; without its last rows."""
    height, width = (max(length - taken + 1, 0) for length, taken in zip(cells.shape, (rows, columns), strict=True))
    strips = np.logical_and.reduce([cells[shift : shift + height] for shift in range(rows)])
    found: NDArray[np.bool_] = np.logical_and.reduce([strips[:, shift : shift + width] for shift in range(columns)])
    return found


def _ticks(low: float, high: float) -> Points:
    """Return cell centres that cover an extent, symmetric about its middle."""
    count = max(int((high - low) / CELL + 1e-6), 1)
    return (low + high) / 2 + (np.arange(count) - (count - 1) / 2) * CELL
