"""Where things can stand: the level tops of receptacles, as grids of free cells.

A surface is derived from collision geometry: every level top of a receptacle's solids, less what
other solids of the home cover, with the free height above each cell.
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_erosion, binary_opening

from chmarl_pb.homes.home import Home, Thing
from chmarl_pb.homes.reach import REACH
from chmarl_pb.homes.solids import Points, Solid, inside

CELL = 0.05  # metres
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
            room = binary_erosion(self.free >= key[2] / 1000, np.ones((rows, columns), dtype=bool))
            self._fits[key] = np.argwhere(room)
        return self._fits[key]


def find_surfaces(home: Home) -> tuple[Surface, ...]:
    """Return every surface of the home's receptacles within the humanoid's reach in height."""
    surfaces = []
    lows = np.array([[*solid.low, solid.bottom] for solid in home.solids])
    highs = np.array([[*solid.high, solid.top] for solid in home.solids])
    for thing in home.receptacles.values():
        level = [solid for solid in thing.solids if solid.has_level_top]
        for height in _levels(level):
            if REACH.height[0] <= height <= REACH.height[1]:
                tops = [solid for solid in level if abs(solid.top - height) <= _SAME_LEVEL]
                surface = _surface(home, thing, height, tops, lows, highs)
                if (surface.free > 0).any():
                    surfaces.append(surface)
    return tuple(surfaces)


def _levels(solids: list[Solid]) -> list[float]:
    """Return the distinct heights of tops, lowest first; close ones count as the highest of them."""
    levels: list[float] = []
    for top in sorted(solid.top for solid in solids):
        if levels and top - levels[-1] <= _SAME_LEVEL:
            levels[-1] = top
        else:
            levels.append(top)
    return levels


def _surface(home: Home, thing: Thing, height: float, tops: list[Solid], lows: Points, highs: Points) -> Surface:
    """Return the surface that some tops of a thing make; lows and highs (n, 3) bound the home's solids."""
    yaw = float(np.arctan2(thing.frame[1, 0], thing.frame[0, 0]))
    axes = np.array([[np.cos(yaw), -np.sin(yaw)], [np.sin(yaw), np.cos(yaw)]])
    corners = np.concatenate([solid.polygon for solid in tops]) @ axes
    low, high = corners.min(axis=0), corners.max(axis=0)
    ticks = [_ticks(a, b) for a, b in zip(low, high, strict=True)]
    points = np.stack(np.meshgrid(*ticks, indexing="ij"), axis=-1) @ axes.T
    on = np.logical_or.reduce([inside(solid.polygon, points, margin=1e-3) for solid in tops])
    free = np.where(on, _TALLEST, 0.0)
    low = np.array([*points.min(axis=(0, 1)) - CELL, height + 2 * _SAME_LEVEL])
    high = np.array([*points.max(axis=(0, 1)) + CELL, height + _TALLEST])
    for number in np.flatnonzero(((low < highs) & (high > lows)).all(axis=1)):
        solid = home.solids[number]
        under = inside(solid.polygon, points, margin=CELL / 2)
        free = np.where(under, np.minimum(free, max(solid.bottom - height, 0.0)), free)
    free[free < _HEADROOM] = 0.0
    free[~binary_opening(free > 0, np.ones((_NARROW, _NARROW), dtype=bool))] = 0.0
    covered = any(
        solid.bottom > height + _HEADROOM and inside(solid.polygon, points[free > 0]).any() for solid in thing.solids
    )
    return Surface(thing.name, height, yaw, points, free, covered)


def _ticks(low: float, high: float) -> Points:
    """Return cell centres that cover an extent, symmetric about its middle."""
    count = max(int((high - low) / CELL + 1e-6), 1)
    return (low + high) / 2 + (np.arange(count) - (count - 1) / 2) * CELL
