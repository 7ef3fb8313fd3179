"""What stands where in a home that is being furnished, and where a robot can still drive. Lengths in centimetres."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from chmarl_pb.homes.generate.doors import Doorway
from chmarl_pb.homes.generate.plan import RASTER, Box, Boxes, Plan, in_metres
from chmarl_pb.homes.walls import Gap, pieces

RADIUS = 25
"""Of a robot that drives, which stands on the raster of the rooms."""

WALL = 10
"""Thickness of all walls."""

_DOOR_FREE = 80  # before and behind a doorway
_LOW, _HIGH = 6, 170  # what reaches between these heights is in the way of robots
_HUNG = 90  # what begins higher than this hangs over free floor

Solid = tuple[int, int, int, int, int, int]
"""Low x, low y, high x, high y, bottom, top."""


class FreeFloor:
    """The furniture of a home so far; every change keeps all rooms and all that holds objects within reach."""

    def __init__(self, plan: Plan, doors: Sequence[Doorway]):
        """Begin with bare rooms."""
        self.size = np.array([box for boxes in plan.values() for box in boxes])[:, 2:].max(axis=0)
        self._solids = np.zeros((0, 6), dtype=np.int64)
        self._keep = np.array([door.zone(_DOOR_FREE) for door in doors], dtype=np.int64).reshape(-1, 4)
        # Points of the raster at even places, the ways between neighbours at odd ones.
        self._open = np.zeros(2 * self.size // RASTER + 1, dtype=bool)
        self._open[::2], self._open[:, ::2] = True, True
        self._doors = [self._index(door.position) for door in doors]
        self._stands: list[list[tuple[slice, slice]]] = []
        for wall in walls(plan, doors):
            self._open &= ~self._blocked((*wall, 0, 250))

    def clear(self, boxes: Boxes, bottom: int, top: int) -> NDArray[np.bool_]:
        """Return which boxes (n, 4) of some height touch nothing, and stand on no floor that is to stay free."""
        solids = self._solids[(bottom < self._solids[:, 5]) & (top > self._solids[:, 4])]
        clear = ~_touch(boxes, solids)
        return clear & ~_touch(boxes, self._keep) if bottom < _HUNG else clear

    def unblocked(self, boxes: Boxes) -> NDArray[np.bool_]:
        """Return on which boxes (n, 4) of floor nothing stands."""
        return ~_touch(boxes, self._solids[self._solids[:, 4] < _HUNG])

    def admit(self, solids: Sequence[Solid], keep: Sequence[Box], stands: Sequence[Sequence[Box]]) -> bool:
        """Put solids into the home unless they cut off a doorway or something that holds objects.

        Args:
            solids: what is added.
            keep: floor that is to stay free from now on.
            stands: for each thing that holds objects, boxes of floor of which one must have room for a robot.
        """
        open_ = self._open.copy()
        for solid in solids:
            if solid[4] < _HIGH and solid[5] > _LOW:
                open_ &= ~self._blocked(solid)
        wanted = [*self._stands, *([self._window(box) for box in boxes] for boxes in stands)]
        if not self._reaches(open_, wanted):
            return False
        self._open, self._stands = open_, wanted
        self._solids = np.concatenate([self._solids, np.array(solids, dtype=np.int64).reshape(-1, 6)])
        self._keep = np.concatenate([self._keep, np.array(keep, dtype=np.int64).reshape(-1, 4)])
        return True

    def _reaches(self, open_: NDArray[np.bool_], stands: Sequence[Sequence[tuple[slice, slice]]]) -> bool:
        """Tell whether one connected floor has all doorways and a place to stand at each thing."""
        parts, _ = label(open_)
        main = parts[self._doors[0]]
        if not main or any(parts[door] != main for door in self._doors):
            return False
        points = (parts == main)[::2, ::2]
        return all(any(points[window].any() for window in windows) for windows in stands)

    def _index(self, point: tuple[int, int]) -> tuple[int, int]:
        return 2 * point[0] // RASTER, 2 * point[1] // RASTER

    def _window(self, box: Box) -> tuple[slice, slice]:
        """Return the points of the raster in a box."""
        x, y = (slice(max(-(-box[axis] // RASTER), 0), max(box[axis + 2] // RASTER + 1, 0)) for axis in (0, 1))
        return x, y

    def _blocked(self, solid: Solid) -> NDArray[np.bool_]:
        """Return at which points and on which ways a robot would touch a solid."""
        squares = []
        for axis in (0, 1):
            place = np.arange(self._open.shape[axis])
            low, high = place // 2 * RASTER, (place + 1) // 2 * RASTER
            away = np.maximum(np.maximum(solid[axis] - high, low - solid[axis + 2]), 0)
            squares.append(away * away)
        blocked: NDArray[np.bool_] = squares[0][:, None] + squares[1][None, :] < RADIUS * RADIUS
        return blocked


def _touch(boxes: Boxes, others: Boxes) -> NDArray[np.bool_]:
    """Return which boxes (n, 4) overlap one of some others (m, 4 or more)."""
    if not len(boxes):
        return np.zeros(0, dtype=bool)
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    near = others[((others[:, :2] < high) & (others[:, 2:4] > low)).all(axis=1)]
    x0, y0, x1, y1 = boxes.T[:, :, None]
    hit = (x0 < near[:, 2]) & (y0 < near[:, 3]) & (x1 > near[:, 0]) & (y1 > near[:, 1])
    touch: NDArray[np.bool_] = hit.any(axis=1)
    return touch


def walls(plan: Plan, doors: Sequence[Doorway]) -> list[Box]:
    """Return the walls of a plan, cut at the doorways."""
    gaps = [
        Gap(door.axis, door.line / 100, (door.middle - door.width / 2) / 100, (door.middle + door.width / 2) / 100)
        for door in doors
    ]
    found = []
    for wall in pieces(in_metres(plan), gaps, WALL / 100):
        line, start, end = (round(100 * value) for value in (wall.line, wall.start, wall.end))
        across = (line - WALL // 2, line + WALL // 2)
        found.append((start, across[0], end, across[1]) if wall.axis == "x" else (across[0], start, across[1], end))
    return found
