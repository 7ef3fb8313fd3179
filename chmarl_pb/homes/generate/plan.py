"""The floor plan: rooms grow round the first one, each beside a room that it may open to. Lengths in centimetres."""

from itertools import product

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import room_kind
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.rooms import RoomRule, rule_of
from chmarl_pb.homes.walls import Rect

Box = tuple[int, int, int, int]
"""Low x, low y, high x, high y, in centimetres."""

Plan = dict[str, tuple[Box, ...]]
"""The rectangles of each room."""

Boxes = NDArray[np.int64]

RASTER = 25
DOORWAY = 175
"""Length of wall that two rooms must share to have a door: it keeps a quarter of a metre to each corner."""

_SIZES = 20  # of a room that are tried
_BEST = 5  # places that one is drawn from
WIDEST = 1900
"""From one end of a plan to the other."""

#: What is liked of a place, drawn once for a home: weights of shared walls, of a short outer wall, of straight lines.
_STYLES = ((2, 1, 2), (3, 2, 2), (2, 2, 3), (1, 1, 3), (1, 0, 3), (3, 1, 3), (2, 0, 3), (1, -1, 4))


def draw_plan(rooms: tuple[str, ...], draws: Draws) -> Plan | None:
    """Return a floor plan, or None where the draws lead to none."""
    style = draws.one_of(_STYLES)
    plan: Plan = {}
    for room in rooms:
        box = _first(rule_of(room), draws) if not plan else _beside(plan, room, style, draws)
        if box is None:
            return None
        plan[room] = (box,)
    for room in draws.shuffled(rooms):
        if draws.chance(rule_of(room).wing):
            _add_wing(plan, room, style, draws)
    return _at_origin(plan) if _fits(plan) else None


def shared(one: Box, others: Boxes) -> Boxes:
    """Return the length of wall that a rectangle shares with each of some others (n, 4)."""
    x0, y0, x1, y1 = others.T
    along_x = np.minimum(one[2], x1) - np.maximum(one[0], x0)
    along_y = np.minimum(one[3], y1) - np.maximum(one[1], y0)
    touch_x = (one[1] == y1) | (one[3] == y0)
    touch_y = (one[0] == x1) | (one[2] == x0)
    return np.where(touch_x, np.maximum(along_x, 0), 0) + np.where(touch_y, np.maximum(along_y, 0), 0)


def in_metres(plan: Plan) -> dict[str, tuple[Rect, ...]]:
    """Return the rectangles of each room in metres."""
    return {
        room: tuple((x0 / 100, y0 / 100, x1 / 100, y1 / 100) for x0, y0, x1, y1 in own) for room, own in plan.items()
    }


def _size(rule: RoomRule, draws: Draws) -> tuple[int, int]:
    """Return a room's width and depth."""
    while True:
        short, long = draws.between(*rule.shorter, RASTER), draws.between(*rule.longer, RASTER)
        if short <= long and rule.area[0] <= short * long // 100 <= rule.area[1]:
            return (short, long) if draws.chance(50) else (long, short)


def _first(rule: RoomRule, draws: Draws) -> Box:
    return (0, 0, *_size(rule, draws))


def _beside(plan: Plan, room: str, style: tuple[int, int, int], draws: Draws) -> Box | None:
    """Return a place for a room that touches one that it may open to."""
    sizes = [_size(rule_of(room), draws) for _ in range(_SIZES)]
    for kind in rule_of(room).opens_to:
        hosts = [box for name, boxes in plan.items() if room_kind(name) == kind for box in boxes]
        if hosts:
            places = np.concatenate([_round(host, size, DOORWAY) for host, size in product(hosts, sizes)])
            box = _choose(plan, places, style, draws)
            if box is not None:
                return box
    return None


def _add_wing(plan: Plan, room: str, style: tuple[int, int, int], draws: Draws) -> None:
    """Add a second part to a room where the plan has a corner to fill."""
    (own,), rule = plan[room], rule_of(room)
    sides = range(rule.shorter[0] if room_kind(room) == "hallway" else 150, rule.shorter[1] + 1, RASTER)
    sizes = [(draws.one_of(sides), draws.one_of(sides)) for _ in range(_SIZES)]
    places = [_round(own, size, min(size)) for size in sizes]
    wings = np.concatenate(places)
    wings = wings[shared(own, wings) >= np.minimum(wings[:, 2] - wings[:, 0], wings[:, 3] - wings[:, 1])]
    others = [box for name, boxes in plan.items() if name != room for box in boxes]
    corner = sum((shared(other, wings) for other in others), np.zeros(len(wings), dtype=np.int64)) >= 150
    flush = (wings[:, None, :] == np.array(own)).any(axis=(1, 2))  # one of its sides goes on in a straight line
    box = _choose(plan, wings[corner & flush], style, draws)
    if box is not None:
        plan[room] = (own, box)


def _round(host: Box, size: tuple[int, int], least: int) -> Boxes:
    """Return all places (n, 4) round a rectangle for one of a size that share at least so much wall with it."""
    width, depth = size
    x0, y0, x1, y1 = host
    across = range(x0 + least - width, x1 - least + 1, RASTER)
    along = range(y0 + least - depth, y1 - least + 1, RASTER)
    corners = [(x, y) for x in across for y in (y0 - depth, y1)] + [(x, y) for y in along for x in (x0 - width, x1)]
    low = np.array(corners, dtype=np.int64).reshape(-1, 2)
    return np.concatenate([low, low + np.array(size)], axis=1)


def _choose(plan: Plan, places: Boxes, style: tuple[int, int, int], draws: Draws) -> Box | None:
    """Return one of the best places for a rectangle, or None where there is none."""
    laid = np.array([box for boxes in plan.values() for box in boxes])
    low, high = laid[:, :2].min(axis=0), laid[:, 2:].max(axis=0)
    free = np.ones(len(places), dtype=bool)
    touching = np.zeros(len(places), dtype=np.int64)
    for box in laid:
        apart = (
            (places[:, 0] >= box[2]) | (places[:, 2] <= box[0]) | (places[:, 1] >= box[3]) | (places[:, 3] <= box[1])
        )
        free &= apart
        touching += shared(tuple(box.tolist()), places)
    growth = (np.maximum(places[:, 2:], high) - np.minimum(places[:, :2], low) - (high - low)).sum(axis=1)
    score = style[0] * touching - style[1] * growth - style[2] * _steps(places, laid)
    order = np.argsort(-score[free], kind="stable")[:_BEST]
    best = places[free][order]
    return None if not len(best) else tuple(best[draws.below(len(best))].tolist())


def _steps(places: Boxes, laid: Boxes) -> Boxes:
    """Return how much each place makes of short steps in walls: edges that nearly, but not quite, go on straight."""
    total = np.zeros(len(places), dtype=np.int64)
    for axis in (0, 1):
        lines = np.unique(laid[:, [axis, axis + 2]])
        for edge in (axis, axis + 2):
            off = np.abs(places[:, edge, None] - lines).min(axis=1)
            total += np.where(off > 0, np.maximum(250 - off, 100), 0)
    return total


def _fits(plan: Plan) -> bool:
    """Tell whether a plan is not too wide and its rooms have outer walls for windows."""
    boxes = np.array([box for own in plan.values() for box in own])
    if (boxes[:, 2:].max(axis=0) - boxes[:, :2].min(axis=0)).max() > WIDEST:
        return False
    return all(_outer(plan, room) >= rule_of(room).daylight for room in plan)


def _outer(plan: Plan, room: str) -> int:
    """Return the length of a room's outer walls."""
    boxes = np.array([box for own in plan.values() for box in own])
    around = sum(2 * (x1 - x0 + y1 - y0) for x0, y0, x1, y1 in plan[room])
    return around - sum(int(shared(box, boxes).sum()) for box in plan[room])


def _at_origin(plan: Plan) -> Plan:
    boxes = [box for own in plan.values() for box in own]
    x, y = min(box[0] for box in boxes), min(box[1] for box in boxes)
    return {room: tuple((b[0] - x, b[1] - y, b[2] - x, b[3] - y) for b in own) for room, own in plan.items()}
