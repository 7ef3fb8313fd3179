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

    def pose(self, along: int, mirror: int = 1) -> Pose:
        """Return the place of a group whose origin stands at a coordinate along the wall."""
        x, y = (along, self.face) if self.yaw in (90, 270) else (self.face, along)
        return Pose(x, y, self.yaw, mirror)


class Spots(NamedTuple):
    """Places of one group: origins (n, 2), and for each the yaw, the mirroring and how little it is liked."""

    origins: Boxes
    yaws: Boxes
    mirrors: Boxes
    costs: Boxes


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
    rows: list[tuple[int, int, int, int, int]] = []
    u0, _, u1, _ = group.area
    for wall in walls:
        left = 1 if wall.yaw in (0, 270) else -1  # direction of u along the wall
        for mirror in (1,) if group.sided else (1, -1):
            low, high = sorted((mirror * left * u0, mirror * left * u1))
            first, last = wall.start - low, wall.end - high
            for along in (*range(first, last, _STEP), last) if first <= last else ():
                ends = min(along - first, last - along)
                cost = {"corner": ends, "middle": abs(2 * along - first - last) // 2}.get(prefer, 0)
                rows.append((*wall.pose(along, mirror), cost // 20))
    return _spots(rows)


def in_middle(boxes: Sequence[Box], prefer: str) -> Spots:
    """Return places in a room given by its rectangles: "middle" ones first, or in any order."""
    rows = []
    for x0, y0, x1, y1 in boxes:
        centre = (x0 + x1) // 2, (y0 + y1) // 2
        for x in range(x0 + _GRID, x1, _GRID):
            for y in range(y0 + _GRID, y1, _GRID):
                off = abs(x - centre[0]) + abs(y - centre[1]) if prefer == "middle" else 0
                rows += [(x, y, yaw, 1, off // 50) for yaw in YAWS]
    return _spots(rows)


def _spots(rows: Sequence[tuple[int, int, int, int, int]]) -> Spots:
    table = np.array(rows, dtype=np.int64).reshape(-1, 5)
    return Spots(table[:, :2], table[:, 2], table[:, 3], table[:, 4])


def inside(boxes: Boxes, rooms: Sequence[Box]) -> NDArray[np.bool_]:
    """Return which boxes (n, 4) keep off the walls of a room that some rectangles make."""
    low, high = boxes[:, :2] - WALL // 2, boxes[:, 2:] + WALL // 2
    covered = np.zeros(len(boxes), dtype=np.int64)
    for x0, y0, x1, y1 in rooms:
        width = np.minimum(high[:, 0], x1) - np.maximum(low[:, 0], x0)
        depth = np.minimum(high[:, 1], y1) - np.maximum(low[:, 1], y0)
        covered += np.maximum(width, 0) * np.maximum(depth, 0)
    whole: NDArray[np.bool_] = covered == (high - low).prod(axis=1)
    return whole
