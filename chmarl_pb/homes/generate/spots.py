"""Where a group of furniture could stand in a room: along its walls, or in the middle. Lengths in centimetres."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.generate.doors import Doorway
from chmarl_pb.homes.generate.free_floor import WALL
from chmarl_pb.homes.generate.groups import Area, Group
from chmarl_pb.homes.generate.plan import Box, Boxes, Plan, in_metres
from chmarl_pb.homes.walls import boundary

YAWS = (0, 90, 180, 270)
TURNS = tuple((yaw, mirror) for yaw in YAWS for mirror in (1, -1))
"""Yaws and mirrorings of groups."""

_STEP = 10  # between places along a wall
_GRID = 25  # between places in the middle of a room
_TRIM = 8  # beside doorways


class Pose(NamedTuple):
    """The place of a group: its origin, the yaw of its front in degrees, and 1, or -1 if it is mirrored."""

    x: int
    y: int
    yaw: int
    mirror: int


@dataclass(frozen=True)
class Stretch:
    """A straight piece of a room's walls without doorways.

    Attributes:
        yaw: direction from the wall into the room, in degrees.
        face: x or y of its surface.
        start: its low end along the wall.
        end: its high end.
        outer: whether the outside lies behind it.
    """

    yaw: int
    face: int
    start: int
    end: int
    outer: bool

    @property
    def length(self) -> int:
        """How long it is."""
        return self.end - self.start


class Spots(NamedTuple):
    """Places of one group: origins (2, n), and for each the number of its turn and how little it is liked (n,)."""

    origins: Boxes
    turns: Boxes
    costs: Boxes

    def take(self, which: NDArray[np.bool_]) -> "Spots":
        """Return some of the places."""
        return Spots(self.origins[:, which], self.turns[which], self.costs[which])

    def pose(self, number: int) -> Pose:
        """Return one of the places."""
        x, y = self.origins[:, number].tolist()
        return Pose(x, y, *TURNS[self.turns[number]])


def placed(area: Area, pose: Pose) -> Box:
    """Return an area of a group's frame in the home."""
    u0, v0, u1, v1 = area
    if pose.mirror < 0:
        u0, u1 = -u1, -u0
    x0, y0, x1, y1 = {
        0: (v0, u0, v1, u1),
        90: (-u1, v0, -u0, v1),
        180: (-v1, -u1, -v0, -u0),
        270: (u0, -v1, u1, -v0),
    }[pose.yaw]
    return pose.x + x0, pose.y + y0, pose.x + x1, pose.y + y1


# How a turn makes an area of another: the number that each of the new ones is, and its sign.
_TURNED = np.array([placed((1, 2, 3, 4), Pose(0, 0, *turn)) for turn in TURNS])
_NUMBERS, _SIGNS = np.abs(_TURNED) - 1, np.sign(_TURNED)


def placed_at(areas: Sequence[Area], spots: Spots) -> Boxes:
    """Return areas of a group's frame at each of some places: (4, areas, places)."""
    turned = np.array(areas, dtype=np.int64).reshape(-1, 4)[:, _NUMBERS] * _SIGNS
    x, y = spots.origins
    boxes: Boxes = turned.transpose(2, 0, 1)[:, :, spots.turns] + np.stack([x, y, x, y])[:, None]
    return boxes


def stretches(plan: Plan, doors: Sequence[Doorway], room: str) -> tuple[Stretch, ...]:
    """Return the walls of a room, longest first."""
    found = []
    for wall in boundary(in_metres(plan)):
        line, start, end = (round(100 * value) for value in (wall.line, wall.start, wall.end))
        cuts = [
            (door.middle - door.width // 2 - _TRIM, door.middle + door.width // 2 + _TRIM)
            for door in doors
            if (door.axis, door.line) == (wall.axis, line) and start < door.middle < end
        ]
        for side, own, other in ((-1, wall.below, wall.above), (1, wall.above, wall.below)):
            if own == room:
                yaw = {("x", -1): 270, ("x", 1): 90, ("y", -1): 180, ("y", 1): 0}[wall.axis, side]
                for low, high in _between(start + WALL // 2, end - WALL // 2, cuts):
                    found.append(Stretch(yaw, line + side * WALL // 2, low, high, not other))
    return tuple(sorted(found, key=lambda stretch: -stretch.length))


def _between(start: int, end: int, cuts: Sequence[tuple[int, int]]) -> list[tuple[int, int]]:
    """Return what cuts leave of a line."""
    left = []
    for low, high in sorted(cuts):
        left.append((start, low))
        start = high
    return [(low, high) for low, high in (*left, (start, end)) if high > low]


def along_walls(group: Group, walls: Sequence[Stretch], prefer: str) -> Spots:
    """Return the places of a group with its back to a wall.

    Args:
        group: the group.
        walls: where it may stand.
        prefer: "corner", "middle" or "any" place along them.
    """
    u0, _, u1, _ = group.area
    rows = []  # turn, whether the wall runs along x, its surface, and where along it the first and the last place are
    for wall in walls:
        for mirror in (1,) if group.sided else (1, -1):
            low, high = (u0, u1) if (wall.yaw in (0, 270)) == (mirror > 0) else (-u1, -u0)
            if high - low <= wall.length:
                turn = TURNS.index((wall.yaw, mirror))
                rows.append((turn, wall.yaw in (90, 270), wall.face, wall.start - low, wall.end - high))
    table = np.array(rows, dtype=np.int64).reshape(-1, 5)
    counts = 1 - (table[:, 3] - table[:, 4]) // _STEP
    turns, level, face, first, last = np.repeat(table, counts, axis=0).T
    number = np.arange(len(turns)) - np.repeat(np.cumsum(counts) - counts, counts)
    along = np.minimum(first + _STEP * number, last)
    costs = np.zeros_like(along)
    if prefer == "corner":
        costs = np.minimum(along - first, last - along) // 20
    elif prefer == "middle":
        costs = np.abs(2 * along - first - last) // 40
    return Spots(np.where(level, (along, face), (face, along)), turns, costs)


def in_middle(boxes: Sequence[Box], prefer: str) -> Spots:
    """Return places in a room given by its rectangles: "middle" ones first, or in any order."""
    turns = [TURNS.index((yaw, 1)) for yaw in YAWS]
    found = []
    for x0, y0, x1, y1 in boxes:
        ticks = np.arange(x0 + _GRID, x1, _GRID), np.arange(y0 + _GRID, y1, _GRID)
        x, y, turn = (grid.ravel() for grid in np.meshgrid(*ticks, turns, indexing="ij"))
        off = np.abs(x - (x0 + x1) // 2) + np.abs(y - (y0 + y1) // 2)
        found.append((x, y, turn, off // 50 if prefer == "middle" else np.zeros_like(off)))
    x, y, turn, costs = np.concatenate(found, axis=1)
    return Spots(np.stack([x, y]), turn, costs)


def inside(boxes: Boxes, rooms: Sequence[Box]) -> NDArray[np.bool_]:
    """Return which boxes (4, ...) keep off the walls of a room that some rectangles make."""
    x0, y0, x1, y1 = boxes
    x0, y0, x1, y1 = x0 - WALL // 2, y0 - WALL // 2, x1 + WALL // 2, y1 + WALL // 2
    covered = np.zeros_like(x0)
    for low_x, low_y, high_x, high_y in rooms:
        width = np.minimum(x1, high_x) - np.maximum(x0, low_x)
        depth = np.minimum(y1, high_y) - np.maximum(y0, low_y)
        covered += np.maximum(width, 0) * np.maximum(depth, 0)
    whole: NDArray[np.bool_] = covered == (x1 - x0) * (y1 - y0)
    return whole
