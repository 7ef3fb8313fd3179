"""What stands where in a home that is being furnished, and where a robot can still drive. Lengths in centimetres."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from chmarl_pb.homes.generate.doors import Doorway
from chmarl_pb.homes.generate.plan import RASTER, WIDEST, Box, Boxes, Plan, in_metres
from chmarl_pb.homes.walls import Gap, pieces

RADIUS = 25
"""Of a robot that drives, which stands on the raster of the rooms."""

WALL = 10
"""Thickness of all walls."""

_DOOR_FREE = 80  # before and behind a doorway
_LOW, _HIGH = 6, 170  # what reaches between these heights is in the way of robots
_HUNG = 90  # what begins higher than this hangs over free floor

# Where points of the raster and the ways between them start and end along an axis.
_STARTS = np.arange(2 * WIDEST // RASTER + 2) // 2 * RASTER
_ENDS = np.append(_STARTS[1:], _STARTS[-1])

Solid = tuple[int, int, int, int, int, int]
"""Low x, low y, high x, high y, bottom, top."""


class FreeFloor:
    """The furniture of a home so far; every change keeps all rooms and all that holds objects within reach."""

    def __init__(self, plan: Plan, doors: Sequence[Doorway]):
        """Begin with bare rooms."""
        self.size = np.array([box for boxes in plan.values() for box in boxes])[:, 2:].max(axis=0)
        self._solids = np.zeros((6, 0), dtype=np.int64)
        self._keep = _columns([door.zone(_DOOR_FREE) for door in doors], 4)
        # Points of the raster at even places, the ways between neighbours at odd ones.
        self._open = np.zeros(2 * self.size // RASTER + 1, dtype=bool)
        self._open[::2], self._open[:, ::2] = True, True
        self._doors = [self._index(door.position) for door in doors]
        self._stands: list[list[tuple[slice, slice]]] = []
        for wall in walls(plan, doors):
            _block(self._open, wall)

    def clear(self, boxes: Boxes, heights: Sequence[tuple[int, int]]) -> NDArray[np.bool_]:
        """Return at which places nothing is touched, and no floor stood on that is to stay free.

        Args:
            boxes: (4, boxes, places) that are to be free at a place.
            heights: bottom and top of each box.
        """
        bottom, top = _columns(heights, 2)[..., None]
        meet = (bottom < self._solids[5]) & (top > self._solids[4])
        stand = np.repeat(bottom < _HUNG, self._keep.shape[1], axis=1)
        others = np.concatenate([self._solids[:4], self._keep], axis=1)
        return ~_touch(boxes, others, np.concatenate([meet, stand], axis=1))

    def unblocked(self, boxes: Boxes) -> NDArray[np.bool_]:
        """Return at which places nothing stands on some boxes (4, boxes, places) of floor."""
        stand = self._solids[4] < _HUNG
        return ~_touch(boxes, self._solids[:4], np.repeat(stand[None], boxes.shape[1], axis=0))

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
                _block(open_, solid[:4])
        wanted = [*self._stands, *([self._window(box) for box in boxes] for boxes in stands)]
        if not self._reaches(open_, wanted):
            return False
        self._open, self._stands = open_, wanted
        self._solids = np.concatenate([self._solids, _columns(solids, 6)], axis=1)
        self._keep = np.concatenate([self._keep, _columns(keep, 4)], axis=1)
        return True

    def _reaches(self, open_: NDArray[np.bool_], stands: Sequence[Sequence[tuple[slice, slice]]]) -> bool:
        """Tell whether one connected floor has all doorways and a place to stand at each thing."""
        if not (
            all(open_[door] for door in self._doors) and _has_room(open_, stands)
        ):  # a cheap test before the dear one
            return False
        parts, _ = label(open_)
        main = parts[self._doors[0]]
        return all(parts[door] == main for door in self._doors) and _has_room(parts == main, stands)

    def _index(self, point: tuple[int, int]) -> tuple[int, int]:
        return 2 * point[0] // RASTER, 2 * point[1] // RASTER

    def _window(self, box: Box) -> tuple[slice, slice]:
        """Return the points of the raster in a box."""
        x, y = (slice(max(-(-box[axis] // RASTER), 0), max(box[axis + 2] // RASTER + 1, 0)) for axis in (0, 1))
        return x, y


def _has_room(floor: NDArray[np.bool_], stands: Sequence[Sequence[tuple[slice, slice]]]) -> bool:
    """Tell whether one of the windows of each stand has a point of a floor."""
    points = floor[::2, ::2]
    return all(any(points[window].any() for window in windows) for windows in stands)


def _columns(rows: Sequence[Sequence[int]], count: int) -> Boxes:
    """Return rows of so many numbers as columns."""
    return np.array(rows, dtype=np.int64).reshape(-1, count).T


def _block(open_: NDArray[np.bool_], box: Box) -> None:
    """Close the points and the ways on which a robot would touch a box."""
    squares, window = [], []
    for axis in (0, 1):
        low, high = box[axis], box[axis + 2]
        near = slice(max(2 * (low // RASTER) - 1, 0), min(2 * -(-high // RASTER) + 2, open_.shape[axis]))
        away = np.maximum(np.maximum(low - _ENDS[near], _STARTS[near] - high), 0)
        squares.append(away * away)
        window.append(near)
    open_[tuple(window)] &= squares[0][:, None] + squares[1] >= RADIUS * RADIUS


def _touch(boxes: Boxes, others: Boxes, matter: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return at which places boxes (4, boxes, places) overlap those of some others (4, m) that matter (boxes, m)."""
    if not boxes.size:
        return np.zeros(boxes.shape[2], dtype=bool)
    x0, y0, x1, y1 = boxes[:, :, None]
    near = (others[0] < x1.max()) & (others[1] < y1.max()) & (others[2] > x0.min()) & (others[3] > y0.min())
    near &= matter.any(axis=0)
    low_x, low_y, high_x, high_y = others[:, near, None]
    hit = (x0 < high_x) & (y0 < high_y) & (x1 > low_x) & (y1 > low_y) & matter[:, near, None]
    touch: NDArray[np.bool_] = hit.any(axis=(0, 1))
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
