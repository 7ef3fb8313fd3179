"""Walls: where they stand follows from the rooms' rectangles and the doors.

A wall stands on every line between two rooms or between a room and the outside, centred on the
line. Rooms lie west and east of a wall that runs along y, south and north of one that runs along x.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Literal

Rect = tuple[float, float, float, float]
"""Low x, low y, high x, high y, in metres."""

Axis = Literal["x", "y"]


@dataclass(frozen=True)
class Wall:
    """A straight piece of wall.

    Attributes:
        axis: the axis that the wall runs along.
        line: its coordinate on the other axis, in metres.
        start: low end along the axis, in metres.
        end: high end along the axis, in metres.
        below: room on the side of lower coordinates (west or south); empty: the outside.
        above: room on the other side (east or north); empty: the outside.
        jambs: which ends (start, end) are doorways.
    """

    axis: Axis
    line: float
    start: float
    end: float
    below: str
    above: str
    jambs: tuple[bool, bool] = (False, False)

    @property
    def owner(self) -> str:
        """The room that the wall's link belongs to."""
        return self.below or self.above


@dataclass(frozen=True)
class Gap:
    """A doorway: the stretch of a line that stays open between two rooms (metres)."""

    axis: Axis
    line: float
    start: float
    end: float


def boundary(rooms: Mapping[str, Sequence[Rect]]) -> list[Wall]:
    """Return the closed walls between all rooms and the outside, without doorways."""
    return list(_boundary(tuple((room, tuple(rects)) for room, rects in rooms.items())))


@lru_cache(maxsize=16)
def _boundary(rooms: tuple[tuple[str, tuple[Rect, ...]], ...]) -> tuple[Wall, ...]:
    """Return the walls of rooms that are asked for again and again while a home is made."""
    return (*_along("x", dict(rooms)), *_along("y", dict(rooms)))


def gap_in(wall: Wall, rooms: tuple[str, str], centre: tuple[float, float], width: float) -> Gap | None:
    """Return the doorway that a door makes in a wall, or None where the wall is not between the two rooms."""
    along, across = centre if wall.axis == "x" else (centre[1], centre[0])
    gap = Gap(wall.axis, wall.line, along - width / 2, along + width / 2)
    fits = wall.start < gap.start and gap.end < wall.end
    return gap if fits and across == wall.line and {wall.below, wall.above} == set(rooms) else None


def pieces(rooms: Mapping[str, Sequence[Rect]], gaps: Sequence[Gap], thickness: float) -> list[Wall]:
    """Return the walls as they stand: cut at the doorways, closed at the corners.

    Args:
        rooms: rectangles of each room, in metres.
        gaps: the doorways.
        thickness: of all walls, in metres.
    """
    walls = boundary(rooms)
    closed = [_close(wall, walls, thickness / 2) for wall in walls]
    return [piece for wall in closed for piece in _cut(wall, gaps)]


def lintels(rooms: Mapping[str, Sequence[Rect]], gaps: Sequence[Gap]) -> list[Wall]:
    """Return the pieces of wall above the doorways, in the order of the doors."""
    walls = boundary(rooms)
    return [
        replace(wall, start=gap.start, end=gap.end)
        for gap in gaps
        for wall in walls
        if (wall.axis, wall.line) == (gap.axis, gap.line) and wall.start < gap.start < wall.end
    ]


def _along(axis: Axis, rooms: Mapping[str, Sequence[Rect]]) -> Iterator[Wall]:
    """Yield the walls along one axis: for each line, the longest runs between the same two sides."""
    first = 0 if axis == "x" else 1
    rects = [rect for room in rooms.values() for rect in room]
    stops = sorted({rect[i] for rect in rects for i in (first, first + 2)})
    for line in sorted({rect[i] for rect in rects for i in (1 - first, 3 - first)}):
        run: Wall | None = None
        for start, end in pairwise(stops):
            middle = (start + end) / 2
            below, above = (_room_at(rooms, axis, middle, line + side) for side in (-1e-3, 1e-3))
            if run and (run.below, run.above) == (below, above):
                run = replace(run, end=end)
                continue
            if run:
                yield run
            run = Wall(axis, line, start, end, below, above) if below != above else None
        if run:
            yield run


def _room_at(rooms: Mapping[str, Sequence[Rect]], axis: Axis, along: float, across: float) -> str:
    """Return the room at a point, or an empty name outside all rooms."""
    x, y = (along, across) if axis == "x" else (across, along)
    for name, rects in rooms.items():
        if any(x0 < x < x1 and y0 < y < y1 for x0, y0, x1, y1 in rects):
            return name
    return ""


def _close(wall: Wall, walls: Sequence[Wall], reach: float) -> Wall:
    """Lengthen the walls along x over the outside of the corners that they form alone with one wall along y."""
    if wall.axis == "y":
        return wall
    start = wall.start - reach if _is_corner(wall, wall.start, walls) else wall.start
    end = wall.end + reach if _is_corner(wall, wall.end, walls) else wall.end
    return replace(wall, start=start, end=end)


def _is_corner(wall: Wall, x: float, walls: Sequence[Wall]) -> bool:
    """Tell whether exactly one other wall, one along y, meets this wall's end."""
    straight = [w for w in walls if w.axis == "x" and w != wall and w.line == wall.line and x in (w.start, w.end)]
    across = [w for w in walls if w.axis == "y" and w.line == x and w.start <= wall.line <= w.end]
    through = any(w.start < wall.line < w.end for w in across)
    return not straight and len(across) == 1 and not through


def _cut(wall: Wall, gaps: Sequence[Gap]) -> Iterator[Wall]:
    """Yield what doorways leave of a wall."""
    inside = [g for g in gaps if (g.axis, g.line) == (wall.axis, wall.line) and wall.start < g.start < wall.end]
    start, jamb = wall.start, False
    for gap in sorted(inside, key=lambda gap: gap.start):
        yield replace(wall, start=start, end=gap.start, jambs=(jamb, True))
        start, jamb = gap.end, True
    yield replace(wall, start=start, jambs=(jamb, False))
