"""Doors by rules: every room opens to one that it may open to; some homes get a way round. Lengths in centimetres."""

from dataclasses import dataclass

from chmarl_pb.catalog import room_kind
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.plan import DOORWAY, RASTER, Plan, in_metres
from chmarl_pb.homes.generate.rooms import rule_of
from chmarl_pb.homes.walls import Axis, Wall, boundary

_CORNER = 25  # from a doorway to the end of its wall
_NARROW, _WIDE = 100, 200
#: Pairs of kinds between which a second way round may open, with its likelihood in per cent.
_ROUND = {("hallway", "kitchen"): 50, ("bedroom", "bathroom"): 30, ("livingroom", "bedroom"): 20}
_OPEN = {"livingroom", "kitchen", "hallway"}  # kinds with wide openings between them


@dataclass(frozen=True)
class Doorway:
    """An opening: the rooms that it joins, the axis of its wall, that wall's line, and its middle and width."""

    between: tuple[str, str]
    axis: Axis
    line: int
    middle: int
    width: int

    @property
    def position(self) -> tuple[int, int]:
        """Its middle."""
        return (self.middle, self.line) if self.axis == "x" else (self.line, self.middle)

    def zone(self, depth: int) -> tuple[int, int, int, int]:
        """Return the rectangle of the doorway with so much before and behind it."""
        low, high, half = self.line - depth, self.line + depth, self.width // 2
        start, end = self.middle - half, self.middle + half
        return (start, low, end, high) if self.axis == "x" else (low, start, high, end)


def draw_doors(plan: Plan, draws: Draws) -> tuple[Doorway, ...] | None:
    """Return the doorways of a floor plan, or None where a room cannot have its door."""
    walls = boundary(in_metres(plan))
    doors: list[Doorway] = []
    first = next(iter(plan))
    for room in plan:
        if room == first:
            continue
        shared = _widest(walls, room, _hosts(plan, room))
        if shared is None:
            return None
        doors.append(_door(shared, draws))
    joined = {frozenset(door.between) for door in doors}
    for one in plan:
        for other in plan:
            likelihood = _ROUND.get((room_kind(one), room_kind(other)), 0)
            wall = _widest(walls, one, [other]) if likelihood and frozenset((one, other)) not in joined else None
            if wall is not None and draws.chance(likelihood):
                doors.append(_door(wall, draws))
    return tuple(doors)


def _hosts(plan: Plan, room: str) -> list[str]:
    """Return the rooms before a room in the plan that it may open to, the best first."""
    before = list(plan)[: list(plan).index(room)]
    return [host for kind in rule_of(room).opens_to for host in before if room_kind(host) == kind]


def _widest(walls: list[Wall], room: str, hosts: list[str]) -> Wall | None:
    """Return the longest wall between a room and the first of some others beside which a door fits."""
    for host in hosts:
        between = [wall for wall in walls if {wall.below, wall.above} == {room, host}]
        longest = max(between, key=lambda wall: wall.end - wall.start, default=None)
        if longest is not None and round(100 * (longest.end - longest.start)) >= DOORWAY:
            return longest
    return None


def _door(wall: Wall, draws: Draws) -> Doorway:
    start, end, line = (round(100 * value) for value in (wall.start, wall.end, wall.line))
    open_ = {room_kind(wall.below), room_kind(wall.above)} <= _OPEN
    widest = min(_WIDE, end - start - 2 * _CORNER)
    width = draws.between(_NARROW, max(widest, _NARROW), 2 * RASTER) if open_ else _NARROW
    low, high = start + _CORNER + width // 2, end - _CORNER - width // 2
    low, high = -(-low // RASTER) * RASTER, high // RASTER * RASTER
    # Near a corner, as most doors are, so that furniture finds long walls.
    middle = draws.one_of((low, high, low, high, draws.between(low, high, RASTER)))
    return Doorway((wall.below, wall.above), wall.axis, line, middle, width)
