"""Furniture that is placed together, as a bed with its nightstands: its parts and the floor that it needs free.

A group has a frame of its own: u runs along the wall behind it, v out of that wall. Lengths in centimetres.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import ceil

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.homes.furniture import load_model

Area = tuple[int, int, int, int]
"""Low u, low v, high u, high v: in the frame of a group."""

FRONT = 75
"""Free floor before what holds objects."""

_FRONTS = {
    "fridge": 75,
    "wardrobe": 70,
    "washing_machine": 60,
    "fireplace": 70,
    "toilet": 60,
    "bathtub": 55,
    "shower": 60,
    "piano": 75,
}
_BESIDE = 60  # of a chair, where a robot stands that reaches for its seat
_SIDED = ("sofa_chaise",)  # models whose left and right differ so much that what stands round them cannot change sides
_AROUND = ("kitchen_table", "coffee_table")  # reached from any side
_EPSILON = 1e-6


@dataclass(frozen=True)
class Extent:
    """The space of a model in its own frame: front towards +x, z = 0 at the bottom."""

    thing_class: str
    x0: int
    y0: int
    x1: int
    y1: int
    height: int


@cache
def extent(model: str) -> Extent:
    """Return the space of a furniture model, rounded outwards, with as much to its left as to its right."""
    loaded = load_model(model)
    back, right, _ = loaded.low.tolist()
    front, left, top = loaded.high.tolist()
    half = _centimetres(max(left, -right))
    return Extent(loaded.thing_class, -_centimetres(-back), -half, _centimetres(front), half, _centimetres(top))


def _centimetres(metres: float) -> int:
    return ceil(100 * metres - _EPSILON)


@dataclass(frozen=True)
class Piece:
    """One piece of a group: its model, where its origin is, its turn to the left in degrees and its bottom's height."""

    model: str
    u: int = 0
    v: int = 0
    turn: int = 0
    z: int = 0

    @property
    def thing_class(self) -> str:
        """Its class."""
        return extent(self.model).thing_class

    @cached_property
    def area(self) -> Area:
        """What it covers."""
        size = extent(self.model)
        return self._placed(size.x0, size.y0, size.x1, size.y1)

    @property
    def top(self) -> int:
        """The height of its top."""
        return self.z + extent(self.model).height

    def front(self, depth: int) -> Area:
        """Return so much floor before it."""
        size = extent(self.model)
        return self._placed(size.x1, size.y0, size.x1 + depth, size.y1)

    def sides(self, depth: int) -> tuple[Area, Area]:
        """Return so much floor on its left and on its right."""
        size = extent(self.model)
        left = self._placed(size.x0, size.y1, size.x1, size.y1 + depth)
        return left, self._placed(size.x0, size.y0 - depth, size.x1, size.y0)

    def behind(self, depth: int) -> Area:
        """Return so much floor behind it."""
        size = extent(self.model)
        return self._placed(size.x0 - depth, size.y0, size.x0, size.y1)

    def _placed(self, x0: int, y0: int, x1: int, y1: int) -> Area:
        """Return an area of the model's frame in the frame of the group."""
        turned = {0: (y0, x0, y1, x1), 90: (x0, -y1, x1, -y0), 180: (-y1, -x1, -y0, -x0), 270: (-x1, y0, -x0, y1)}
        u0, v0, u1, v1 = turned[self.turn % 360]
        return self.u + u0, self.v + v0, self.u + u1, self.v + v1


@dataclass(frozen=True)
class Group:
    """Furniture that is placed together.

    Attributes:
        parts: its pieces.
        keep: floor on which nothing else may stand.
        stands: for each thing that holds objects, areas of which one at least must have room for a robot.
        margin: free space all round, for a group in the middle of a room.
        sided: whether it cannot be mirrored.
    """

    parts: tuple[Piece, ...]
    keep: tuple[Area, ...] = ()
    stands: tuple[tuple[Area, ...], ...] = ()
    margin: int = 0
    sided: bool = False

    @cached_property
    def area(self) -> Area:
        """What its parts cover."""
        return around([part.area for part in self.parts])

    @property
    def around(self) -> Area:
        """The same with its margin."""
        u0, v0, u1, v1 = self.area
        return u0 - self.margin, v0 - self.margin, u1 + self.margin, v1 + self.margin

    @cached_property
    def solid(self) -> tuple[Piece, ...]:
        """Its parts but for rugs, on which others may stand."""
        return tuple(part for part in self.parts if part.thing_class != "rug")


def around(areas: Sequence[Area]) -> Area:
    """Return the smallest area that holds some."""
    u0, v0, u1, v1 = zip(*areas, strict=True)
    return min(u0), min(v0), max(u1), max(v1)


def group(*parts: Piece, keep: Sequence[Area] = (), margin: int = 0) -> Group:
    """Return a group with the free floor that its parts need."""
    fronts = [part.front(_front(part)) for part in parts if _front(part)]
    stands = [_stands(part) for part in parts if part.thing_class in BENCHMARK.receptacles]
    sided = any(part.model in _SIDED for part in parts)
    return Group(tuple(parts), (*keep, *fronts), tuple(stands), margin, sided)


def at_wall(model: str, u: int = 0, z: int = 0, gap: int = 0) -> Piece:
    """Return a piece with its back to the wall of its group, or so far off it."""
    return Piece(model, u, gap - extent(model).x0, 0, z)


def wide(model: str) -> int:
    """Return the width of a model."""
    return extent(model).y1 - extent(model).y0


def moved(part: Piece, u: int, v: int) -> Piece:
    """Return a part elsewhere."""
    return replace(part, u=part.u + u, v=part.v + v)


def _front(part: Piece) -> int:
    """Return how much floor before a part must stay free."""
    if part.z:
        return 0
    free = part.thing_class in ("chair", "bed", "nightstand", *_AROUND) or part.model == "kitchen_counter_island"
    return _FRONTS.get(part.thing_class, FRONT if part.thing_class in BENCHMARK.receptacles and not free else 0)


def _stands(part: Piece) -> tuple[Area, ...]:
    """Return where a robot may stand to reach what lies on a part."""
    if part.model == "chair_armchair":
        return (part.front(FRONT),)
    if part.thing_class == "chair":
        return part.sides(_BESIDE)
    if part.thing_class == "bed":
        return (*part.sides(FRONT), part.front(FRONT))
    if part.thing_class in _AROUND or part.model == "kitchen_counter_island":
        return (*part.sides(FRONT), part.front(FRONT), part.behind(FRONT))
    return (part.front(FRONT),)
