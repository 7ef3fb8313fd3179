"""Where robots can be: the humanoid's 0.25 m lattice with twelve headings, the drone's 0.5 m lattice.

The lattices are laid on the world's origin, so that they do not depend on the order of links.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components, dijkstra

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.home import Home
from chmarl_pb.homes.solids import Points, Solid, apart, inside, segments_hit

SPACING = 0.25  # metres between neighbouring positions of the humanoid
HEADINGS = 12  # of 30 degrees each; heading 0 looks along +x, 3 along +y
FORWARD = 0.5  # metres of one Move Forward
FOOTPRINT_RADIUS = 0.25  # metres, of the humanoid's base with its safety margin
BODY = (0.06, 1.7)  # metres: lower things are driven over, higher ones passed under

DRONE_SPACING = 0.5
DRONE_MOVE = 1.0
DRONE_HEIGHT = 3.5
DRONE_HEADING = np.pi / 2  # its forward is +y, so that its picture lies like the plan

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
_OBSTACLES_AT_ONCE, _CORNERS_AT_ONCE = 64, 2**20  # tested together, so that memory is bounded in any home
_DRIVE_CELLS = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j])
#: The drone's moves forward, backward, left, right in cells of its lattice.
DRONE_CELLS = np.array([(0, 2), (0, -2), (-2, 0), (2, 0)])


def heading_angle(heading: int) -> float:
    """Return the angle in radians of one of the twelve headings."""
    return 2 * np.pi * heading / HEADINGS


@dataclass(frozen=True, eq=False)
class Lattice:
    """The humanoid's lattice of one home.

    A pose is one integer: ``position * HEADINGS + heading``.

    Attributes:
        points: (n, 2) positions, metres, sorted by x then y.
        forward: (n, HEADINGS) position after Move Forward, -1 where it is blocked.
        roads: (n, n) lengths in metres of drives between neighbours.
        rooms: (n,) index of each position's room in ``list(home.rooms)``.
        anchors: Goto room -> pose that Goto drives to.
        obstacles: what the base can touch.
    """

    points: Points
    forward: NDArray[np.int32]
    roads: csr_array
    rooms: NDArray[np.int32]
    anchors: dict[str, int]
    obstacles: tuple[Solid, ...]

    @cached_property
    def moves(self) -> NDArray[np.int32]:
        """The pose (poses, rooms + 3) after each Goto, Move Forward, Turn Left and Turn Right; -1 where blocked."""
        position, heading = np.divmod(np.arange(len(self.points) * HEADINGS), HEADINGS)
        ahead = self.forward[position, heading]
        gotos = [np.full(len(position), pose) for pose in self.anchors.values()]
        forward = np.where(ahead < 0, -1, ahead * HEADINGS + heading)
        turns = [position * HEADINGS + (heading + turn) % HEADINGS for turn in (1, -1)]
        return np.stack([*gotos, forward, *turns], axis=1).astype(np.int32)

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
            starts = np.repeat(self.points[corners[-1]][None], len(rest), axis=0)
            free = ~_blocked(list(self.obstacles), starts, self.points[list(rest)])
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
    """The drone's lattice of one home: positions over its floors, at ``DRONE_HEIGHT``.

    Attributes:
        points: (n, 2) positions in metres.
        moves: (n, 4) position after a move forward, backward, left, right; -1 outside the outline.
        rooms: (n,) index of each position's room in ``list(home.rooms)``.
        anchors: Goto room -> position above its centre.
    """

    points: Points
    moves: NDArray[np.int32]
    rooms: NDArray[np.int32]
    anchors: dict[str, int]


def build_lattice(home: Home) -> Lattice:
    """Derive the humanoid's lattice from the home's collision geometry.

    Raises:
        HomeError: a room cannot be reached from the largest connected part of the home.
    """
    cells, rooms = _cells_on_floors(home, SPACING)
    obstacles = [solid for solid in home.solids if solid.spans(*BODY)]
    here = cells * SPACING
    free = ~_blocked(obstacles, here, here)
    cells, rooms = cells[free], rooms[free]
    starts, ends, _ = _links(cells, _DRIVE_CELLS, obstacles)
    count, part = connected_components(_graph(cells, starts, ends), directed=False)
    kept = part == np.bincount(part, minlength=count).argmax() if len(cells) else np.zeros(0, dtype=bool)
    for number, name in enumerate(home.rooms):
        if not (rooms[kept] == number).any():
            raise HomeError(
                f"{home.path}: room {name!r} cannot be reached; doors need a free width of at least 0.75 m "
                "and a free way of 0.5 m beside the furniture"
            )
    cells, rooms = cells[kept], rooms[kept]
    renumbered = np.cumsum(kept) - 1
    starts, ends = renumbered[starts[kept[starts]]], renumbered[ends[kept[ends]]]
    points = cells * SPACING
    forward = _forward(cells, obstacles)
    anchors = {name: _anchor(home, name, points, rooms == list(home.rooms).index(name)) for name in home.goto_rooms}
    return Lattice(points, forward, _graph(cells, starts, ends), rooms, anchors, tuple(obstacles))


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
    cells: NDArray[np.int64], offsets: NDArray[np.int64], obstacles: list[Solid]
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """Return start, end and number of the offset of all moves by an offset that stay free all the way."""
    neighbours = _neighbours(cells, offsets)
    numbers, starts = np.nonzero(neighbours.T >= 0)
    ends = neighbours[starts, numbers].astype(int)
    free = ~_blocked(obstacles, cells[starts] * SPACING, cells[ends] * SPACING)
    return starts[free], ends[free], numbers[free]


def _blocked(obstacles: list[Solid], starts: Points, ends: Points) -> NDArray[np.bool_]:
    """Return which straight drives of the humanoid's footprint touch an obstacle."""
    blocked = np.zeros(len(starts), dtype=bool)
    for corners in sorted({len(solid.polygon) for solid in obstacles}):
        outlines = np.stack([solid.polygon for solid in obstacles if len(solid.polygon) == corners], axis=1)
        for first in range(0, outlines.shape[1], _OBSTACLES_AT_ONCE):
            some, left = outlines[:, first : first + _OBSTACLES_AT_ONCE], np.flatnonzero(~blocked)
            drives, solids = _near(some, starts[left], ends[left])
            step = _CORNERS_AT_ONCE // corners + 1
            for part in (slice(at, at + step) for at in range(0, len(drives), step)):
                there, outline = left[drives[part]], some[:, solids[part]]
                close = ~apart(outline, starts[there], ends[there], FOOTPRINT_RADIUS)
                there, outline = there[close], outline[:, close]
                # A hair less than the radius: a doorway of exactly the footprint's width is passable.
                hit = segments_hit(outline, starts[there], ends[there], FOOTPRINT_RADIUS - 1e-6)
                blocked[there[hit]] = True
    return blocked


def _near(outlines: Points, starts: Points, ends: Points) -> tuple[NDArray[np.intp], ...]:
    """Return the numbers of drives and of outlines (k, n, 2) whose bounding boxes meet."""
    low, high = np.minimum(starts, ends) - FOOTPRINT_RADIUS, np.maximum(starts, ends) + FOOTPRINT_RADIUS
    (x0, y0), (x1, y1) = outlines.min(axis=0).T, outlines.max(axis=0).T
    return np.nonzero((low[:, :1] < x1) & (low[:, 1:] < y1) & (high[:, :1] > x0) & (high[:, 1:] > y0))


def _graph(cells: NDArray[np.int64], starts: NDArray[np.int64], ends: NDArray[np.int64]) -> csr_array:
    lengths = np.linalg.norm((cells[ends] - cells[starts]) * SPACING, axis=1)
    return csr_array((lengths, (starts, ends)), shape=(len(cells), len(cells)))


def _forward(cells: NDArray[np.int64], obstacles: list[Solid]) -> NDArray[np.int32]:
    forward = np.full((len(cells), HEADINGS), -1, dtype=np.int32)
    starts, ends, headings = _links(cells, FORWARD_CELLS, obstacles)
    forward[starts, headings] = ends
    return forward


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
