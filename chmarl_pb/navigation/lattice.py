"""Where robots can be: those that drive on a 0.25 m lattice with twelve headings, those that fly on a 0.5 m lattice.

The lattices are laid on the world's origin, so that they do not depend on the order of links.
"""

from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.solids import Points, Solid, apart, inside, segments_hit

SPACING = 0.25  # metres between neighbouring positions of robots that drive
HEADINGS = 12  # of 30 degrees each; heading 0 looks along +x, 3 along +y
FORWARD = 0.5  # metres of one Move Forward
DRONE_SPACING = 0.5
DRONE_HEADING = np.pi / 2  # of robots that fly: forward is +y, so that a picture lies like the plan


class Footprint(NamedTuple):
    """The room that a driving robot takes.

    Attributes:
        radius: of the base with its safety margin, metres.
        low: height in metres below which things are driven over.
        high: height in metres above which things are passed under.
    """

    radius: float = 0.25
    low: float = 0.06
    high: float = 1.7


FOOTPRINT = Footprint()

#: Forward moves in cells: 0.5 m along the heading, to the nearest lattice position.
FORWARD_CELLS = np.array(
    [
        np.round(
            np.array([np.cos(2 * np.pi * k / HEADINGS), np.sin(2 * np.pi * k / HEADINGS)]) * FORWARD / SPACING + 1e-9
        )
        for k in range(HEADINGS)
    ],
    dtype=int,
)
_OBSTACLES_AT_ONCE, _CORNERS_AT_ONCE = 512, 2**20  # tested together, so that memory is bounded in any home
_DRIVE_CELLS = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j])
#: The drone's moves forward, backward, left, right in cells of its lattice.
DRONE_CELLS = np.array([(0, 2), (0, -2), (-2, 0), (2, 0)])


def heading_angle(heading: int) -> float:
    """Return the angle in radians of one of the twelve headings."""
    return 2 * np.pi * heading / HEADINGS


#: Cosine and sine of each heading.
DIRECTIONS = tuple((float(np.cos(angle)), float(np.sin(angle))) for angle in map(heading_angle, range(HEADINGS)))


@dataclass(frozen=True, eq=False)
class Lattice:
    """Where robots of one footprint can drive in one home.

    A pose is one integer: ``position * HEADINGS + heading``.

    Attributes:
        points: (n, 2) positions, metres, sorted by x then y.
        forward: (n, HEADINGS) position after Move Forward, -1 where it is blocked.
        roads: (n, n) lengths in metres of drives between neighbours.
        rooms: (n,) index of each position's room in ``list(home.rooms)``.
        anchors: Goto room -> pose that Goto drives to.
        obstacles: what the base can touch.
        footprint: of the robots.
    """

    points: Points
    forward: NDArray[np.int32]
    roads: csr_array
    rooms: NDArray[np.int32]
    anchors: dict[str, int]
    obstacles: tuple[Solid, ...]
    footprint: Footprint

    steps: ClassVar[tuple[str, ...]] = ("move_forward", "turn_left", "turn_right")

    @cached_property
    def moves(self) -> NDArray[np.int32]:
        """The pose (poses, rooms + 3) after each Goto, then after each of ``steps``; -1 where blocked."""
        position, heading = np.divmod(np.arange(self.count), HEADINGS)
        ahead = self.forward[position, heading]
        gotos = [np.full(len(position), pose) for pose in self.anchors.values()]
        forward = np.where(ahead < 0, -1, ahead * HEADINGS + heading)
        turns = [position * HEADINGS + (heading + turn) % HEADINGS for turn in (1, -1)]
        return np.stack([*gotos, forward, *turns], axis=1).astype(np.int32)

    @property
    def count(self) -> int:
        """Number of poses."""
        return len(self.points) * HEADINGS

    def cell(self, pose: int) -> int:
        """Return the position of a pose: robots on one lattice never stand in one."""
        return pose // HEADINGS

    def heading(self, pose: int) -> int:
        """Return the heading of a pose, in steps of 30 degrees from +x."""
        return pose % HEADINGS

    def nearest(self, pose: int, taken: Collection[int]) -> int:
        """Return the pose of the same heading in the nearest cell that is not taken; -1 if all are."""
        cell = _nearest(self.points, self.cell(pose), taken)
        return -1 if cell < 0 else cell * HEADINGS + self.heading(pose)

    @cached_property
    def _rows(self) -> dict[int, tuple[NDArray[np.float64], NDArray[np.int32]]]:
        return {}

    def _row(self, goal: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
        """Return the distance to a goal position from everywhere, and the next position on the way."""
        if goal not in self._rows:
            distance, following = dijkstra(self.roads, directed=False, indices=goal, return_predecessors=True)
            self._rows[goal] = (distance, following)
        return self._rows[goal]

    def distance(self, start: int, goal: int) -> float:
        """Return the length in metres of the shortest drive between two positions."""
        return float(self._row(goal)[0][start])

    def path(self, start: int, goal: int) -> list[int]:
        """Return the positions of the shortest drive, both ends included."""
        following = self._row(goal)[1]
        path = [start]
        while path[-1] != goal:
            path.append(int(following[path[-1]]))
        return path

    def waypoints(self, path: tuple[int, ...]) -> Points:
        """Return the corners (m, 2) of a drive along a path, cut short where the straight way is free."""
        corners = [path[0]]
        while corners[-1] != path[-1]:
            rest = path[path.index(corners[-1]) + 1 :]
            starts = np.full(len(rest), corners[-1])
            free = ~_blocked(list(self.obstacles), self.points, starts, np.array(rest), self.footprint.radius)
            free[0] = True
            corners.append(rest[int(np.flatnonzero(free)[-1])])
        return self.points[corners]

    def pose(self, pose: int) -> tuple[float, float, float]:
        """Return x, y (metres) and heading (radians) of a pose."""
        position, heading = divmod(pose, HEADINGS)
        x, y = self.points[position]
        return float(x), float(y), heading_angle(heading)


@dataclass(frozen=True, eq=False)
class DroneLattice:
    """Where robots can fly in one home: positions over its floors, all with the same heading.

    Attributes:
        points: (n, 2) positions in metres.
        neighbours: (n, 4) position after a move forward, backward, left, right; -1 outside the outline.
        rooms: (n,) index of each position's room in ``list(home.rooms)``.
        anchors: Goto room -> position above its centre.
    """

    points: Points
    neighbours: NDArray[np.int32]
    rooms: NDArray[np.int32]
    anchors: dict[str, int]

    steps: ClassVar[tuple[str, ...]] = ("move_forward", "move_backward", "move_left", "move_right")

    @cached_property
    def moves(self) -> NDArray[np.int32]:
        """The position (n, rooms + 4) after each Goto, then after each of ``steps``; -1 where blocked."""
        gotos = [np.full(self.count, pose) for pose in self.anchors.values()]
        return np.column_stack([*gotos, self.neighbours]).astype(np.int32)

    @property
    def count(self) -> int:
        """Number of positions."""
        return len(self.points)

    def pose(self, pose: int) -> tuple[float, float, float]:
        """Return x, y (metres) and heading (radians) at a position."""
        x, y = self.points[pose].tolist()
        return x, y, DRONE_HEADING

    def cell(self, pose: int) -> int:
        """Return the position itself."""
        return pose

    def heading(self, pose: int) -> int:
        """Return the heading, in steps of 30 degrees from +x."""
        return round(DRONE_HEADING / heading_angle(1))

    def nearest(self, pose: int, taken: Collection[int]) -> int:
        """Return the nearest position that is not taken; -1 if all are."""
        return _nearest(self.points, pose, taken)


AnyLattice = Lattice | DroneLattice


def build_lattice(home: Home, footprint: Footprint = FOOTPRINT) -> Lattice:
    """Derive the lattice of robots of a footprint from the home's collision geometry.

    Raises:
        HomeError: a room cannot be reached from the largest connected part of the home.
    """
    lattice, missed = reached_lattice(home, footprint)
    if missed:
        rooms = f"room {missed[0]!r}" if len(missed) == 1 else f"rooms {', '.join(map(repr, missed))}"
        raise HomeError(f"{home.path}: {rooms} {unreachable(footprint)}")
    return lattice


def unreachable(footprint: Footprint) -> str:
    """Return what is wrong with a room that robots of a footprint do not reach, and what to do about it."""
    whom = "" if footprint == FOOTPRINT else f" by a robot with radius = {footprint.radius:g}"
    return (
        f"cannot be reached{whom}; doors need a free width of at least {2 * footprint.radius + 0.25:.2f} m and a free "
        f"way of {2 * footprint.radius:.1f} m beside the furniture"
    )


def reached_lattice(home: Home, footprint: Footprint) -> tuple[Lattice, list[str]]:
    """Return the lattice of the largest connected part of a home, and the rooms that it does not reach."""
    cells, rooms = _cells_on_floors(home, SPACING)
    obstacles = [solid for solid in home.solids if solid.spans(footprint.low, footprint.high)]
    here = np.arange(len(cells))
    free = ~_blocked(obstacles, cells * SPACING, here, here, footprint.radius)
    cells, rooms = cells[free], rooms[free]
    starts, ends, _ = _links(cells, _DRIVE_CELLS, obstacles, footprint.radius)
    count, part = connected_components(_graph(cells, starts, ends), directed=False)
    kept = part == np.bincount(part, minlength=count).argmax() if len(cells) else np.zeros(0, dtype=bool)
    cells, rooms = cells[kept], rooms[kept]
    renumbered = np.cumsum(kept) - 1
    starts, ends = renumbered[starts[kept[starts]]], renumbered[ends[kept[ends]]]
    points = cells * SPACING
    forward = _forward(cells, obstacles, footprint.radius)
    numbers = {name: number for number, name in enumerate(home.rooms)}
    missed = [name for name, number in numbers.items() if not (rooms == number).any()]
    anchors = {
        name: _anchor(home, name, points, rooms == numbers[name]) for name in home.goto_rooms if name not in missed
    }
    lattice = Lattice(points, forward, _graph(cells, starts, ends), rooms, anchors, tuple(obstacles), footprint)
    return lattice, missed


def build_drone_lattice(home: Home) -> DroneLattice:
    """Derive the drone's lattice: every 0.5 m over the floors, inside the outer walls."""
    cells, rooms = _cells_on_floors(home, DRONE_SPACING)
    moves = _neighbours(cells, DRONE_CELLS)
    points = cells * DRONE_SPACING
    anchors = {}
    for name in home.goto_rooms:
        own = np.flatnonzero(rooms == list(home.rooms).index(name))
        anchors[name] = int(own[np.linalg.norm(points[own] - home.rooms[name].centre, axis=1).argmin()])
    return DroneLattice(points, moves, rooms, anchors)


def _cells_on_floors(home: Home, spacing: float) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """Return the lattice cells (n, 2) on any floor and the index of their room."""
    low, high = home.bounds
    axes = [
        np.arange(np.ceil(a / spacing - 1e-9), np.floor(b / spacing + 1e-9) + 1) for a, b in zip(low, high, strict=True)
    ]
    cells = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2).astype(int)
    rooms = np.full(len(cells), -1, dtype=np.int32)
    points = cells * spacing
    for number, room in enumerate(home.rooms.values()):
        for floor in room.floors:
            near = (points > floor.min(axis=0) - 1e-6).all(axis=1) & (points < floor.max(axis=0) + 1e-6).all(axis=1)
            there = np.flatnonzero((rooms < 0) & near)
            rooms[there[inside(floor, points[there])]] = number
    return cells[rooms >= 0], rooms[rooms >= 0]


def _neighbours(cells: NDArray[np.int64], offsets: NDArray[np.int64]) -> NDArray[np.int32]:
    """Return the number (n, offsets) of the cell at each offset from each cell, -1 where there is none."""
    if not len(cells):
        return np.zeros((0, len(offsets)), dtype=np.int32)
    margin = np.abs(offsets).max()
    places = cells - cells.min(axis=0) + margin
    numbers = np.full(places.max(axis=0) + margin + 1, -1, dtype=np.int32)
    numbers[tuple(places.T)] = np.arange(len(cells))
    neighbours: NDArray[np.int32] = numbers[tuple(np.moveaxis(places[:, None] + offsets, -1, 0))]
    return neighbours


def _links(
    cells: NDArray[np.int64], offsets: NDArray[np.int64], obstacles: list[Solid], radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return start, end and number of the offset of all moves by an offset that stay free all the way."""
    neighbours = _neighbours(cells, offsets)
    numbers, starts = np.nonzero(neighbours.T >= 0)
    ends = neighbours[starts, numbers].astype(int)
    free = ~_blocked(obstacles, cells * SPACING, starts, ends, radius)
    return starts[free], ends[free], numbers[free]


def _blocked(
    obstacles: list[Solid], points: Points, starts: NDArray[np.int64], ends: NDArray[np.int64], radius: float
) -> NDArray[np.bool_]:
    """Return which straight drives of a base of a radius, from points to points by their numbers, touch an obstacle."""
    blocked = np.zeros(len(starts), dtype=bool)
    for corners in sorted({len(solid.polygon) for solid in obstacles}):
        outlines = np.stack([solid.polygon for solid in obstacles if len(solid.polygon) == corners], axis=1)
        for first in range(0, outlines.shape[1], _OBSTACLES_AT_ONCE):
            some, left = outlines[:, first : first + _OBSTACLES_AT_ONCE], np.flatnonzero(~blocked)
            drives, solids = _near(some, points, starts[left], ends[left], radius)
            step = _CORNERS_AT_ONCE // corners + 1
            for part in (slice(at, at + step) for at in range(0, len(drives), step)):
                there, outline = left[drives[part]], some[:, solids[part]]
                close = ~apart(outline, points[starts[there]], points[ends[there]], radius)
                there, outline = there[close], outline[:, close]
                # A hair less than the radius: a doorway of exactly the footprint's width is passable.
                hit = segments_hit(outline, points[starts[there]], points[ends[there]], radius - 1e-6)
                blocked[there[hit]] = True
    return blocked


def _near(
    outlines: Points, points: Points, starts: NDArray[np.int64], ends: NDArray[np.int64], radius: float
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Return the numbers of drives and of outlines (k, n, 2) whose bounding boxes meet."""
    (x0, y0), (x1, y1) = outlines.min(axis=0).T, outlines.max(axis=0).T
    # Many drives start at each point: outlines far from it are left out for all of them at once.
    reach = radius + np.abs(points[ends] - points[starts]).max(initial=0.0)
    x, y = points.T[..., None]
    close = (x > x0 - reach) & (x < x1 + reach) & (y > y0 - reach) & (y < y1 + reach)
    drives, solids = csr_array(close)[starts].nonzero()
    begin, end = points[starts[drives]], points[ends[drives]]
    low, high = (np.minimum(begin, end) - radius).T, (np.maximum(begin, end) + radius).T
    meet = (low[0] < x1[solids]) & (low[1] < y1[solids]) & (high[0] > x0[solids]) & (high[1] > y0[solids])
    return drives[meet], solids[meet]


def _graph(cells: NDArray[np.int64], starts: NDArray[np.int64], ends: NDArray[np.int64]) -> csr_array:
    lengths = np.linalg.norm((cells[ends] - cells[starts]) * SPACING, axis=1)
    places = starts.astype(np.int32), ends.astype(np.int32)  # SciPy before 1.15 searches no graph with longer indices
    return csr_array((lengths, places), shape=(len(cells), len(cells)))


def _forward(cells: NDArray[np.int64], obstacles: list[Solid], radius: float) -> NDArray[np.int32]:
    forward = np.full((len(cells), HEADINGS), -1, dtype=np.int32)
    starts, ends, headings = _links(cells, FORWARD_CELLS, obstacles, radius)
    forward[starts, headings] = ends
    return forward


def _nearest(points: Points, cell: int, taken: Collection[int]) -> int:
    """Return the cell nearest to one that is not taken, of equally near ones the first; -1 if all are."""
    distance = np.linalg.norm(points - points[cell], axis=1)
    distance[list(taken)] = np.inf
    nearest = int(distance.argmin())
    return nearest if np.isfinite(distance[nearest]) else -1


def _anchor(home: Home, room: str, points: Points, own: NDArray[np.bool_]) -> int:
    """Return the pose nearest to the room's centre, turned to where most of its receptacles are."""
    candidates = np.flatnonzero(own)
    position = int(candidates[np.linalg.norm(points[candidates] - home.rooms[room].centre, axis=1).argmin()])
    centres = np.array([t.centre for t in home.receptacles.values() if t.room == room]).reshape(-1, 2)
    away = centres - points[position]
    bearings = np.arctan2(away[:, 1], away[:, 0])
    angles = np.array([heading_angle(k) for k in range(HEADINGS)])
    off = np.abs((bearings - angles[:, None] + np.pi) % (2 * np.pi) - np.pi)
    facing = (off < np.pi / 4).sum(axis=1)
    # Among equally good headings take the one that looks most squarely at what it faces.
    squareness = np.where(off < np.pi / 4, off, 0).sum(axis=1)
    heading = min(range(HEADINGS), key=lambda k: (-facing[k], squareness[k], k))
    return position * HEADINGS + heading
