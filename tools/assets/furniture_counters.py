"""Counters of kitchen and bathroom, with and without basins, and the tap."""

from collections.abc import Iterator

import numpy as np

from tools.assets.furniture_model import Block, Model, Vector, tray
from tools.assets.furniture_storage import FRONT, HANDLE, Span, carcass, fronts
from tools.assets.meshes import Mesh, box, join, rectangle, rounded_rectangle, tube


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        _counter("kitchen_counter_straight", 0.62, 1.8, 3, "white", "oak"),
        kitchen_counter_sink(),
        _counter("kitchen_counter_short", 0.62, 1.0, 2, "white", "oak"),
        _counter("kitchen_counter_island", 0.8, 1.6, 3, "navy", "marble"),
        _bathroom_counter("bathroom_counter_single", (0.5, 0.9, 0.85), 0.22, 2, "white", "oak"),
        _bathroom_counter("bathroom_counter_double", (0.52, 1.4, 0.85), 0.42, 3, "oak", "marble"),
    ]


def _counter(name: str, depth: float, width: float, columns: int, colour: str, top: str) -> Model:
    """Return a kitchen counter with doors under a row of drawers."""
    model = Model(name, primary=colour, secondary=top)
    x = carcass(model, (depth, width, 0.9), top=0.04, plinth=0.1)
    _kitchen_fronts(model, x, width, columns)
    return model


def _kitchen_fronts(model: Model, x: float, width: float, columns: int) -> None:
    """Add doors and, above them, drawers at plane ``x``."""
    fronts(model, x, (-width / 2, width / 2), (0.1, 0.66), columns, 1, "door", part="door_")
    fronts(model, x, (-width / 2, width / 2), (0.66, 0.86), columns, 1, "drawer", part="drawer_")


def kitchen_counter_sink() -> Model:
    """Return a kitchen counter with a sink of two bowls and, on the left of who works there, a free half."""
    model = Model("kitchen_counter_sink", primary="white", secondary="oak")
    x, y, floor = 0.03, 0.45, 0.74
    front = _open_carcass(model, (0.62, 1.8, 0.9), 0.1, floor)
    _kitchen_fronts(model, front, 1.8, 3)
    _worktop(model, (0.62, 1.8, 0.9), (x, y), hole=(0.42, 0.55), well=(0.38, 0.5), floor=floor)
    bowl = tray(rectangle(0.44, 0.28), rectangle(0.38, 0.235), 0.165, 0.0, 0.9)
    model.shape("sink", "steel", *(bowl.moved(x, y + side * 0.1375, floor) for side in (-1, 1)))
    model.solid((0.38, 0.03, 0.165), (x, y, floor))
    _tap(model, (-0.24, y, 0.9), height=0.26, reach=0.2)
    return model


def _bathroom_counter(name: str, size: Vector, basin_y: float, columns: int, colour: str, top: str) -> Model:
    """Return a vanity: doors below, a sunk basin with a tap on the right, free top on the left, seen from the front."""
    model = Model(name, primary=colour, secondary=top)
    depth, width, height = size
    floor = height - 0.13
    x = _open_carcass(model, size, 0.1, floor)
    fronts(model, x, (-width / 2, width / 2), (0.1, height - 0.04), columns, 1, "door")
    _worktop(model, size, (0.04, basin_y), hole=(0.32, 0.4), well=(0.22, 0.34), floor=floor)
    outer, inner = rounded_rectangle(0.36, 0.44, 0.08, 1), rounded_rectangle(0.3, 0.38, 0.07, 1)
    model.shape("basin", "ceramic", tray(outer, inner, 0.135, 0.0, 0.75).moved(0.04, basin_y, floor))
    _tap(model, (0.06 - depth / 2, basin_y, height), height=0.17, reach=0.15)
    return model


def _open_carcass(model: Model, size: Vector, plinth: float, floor: float) -> float:
    """Add a counter's body that is hollow above ``floor``, for a basin.

    Returns:
        The plane x on which fronts go.
    """
    depth, width, height = size
    body, x, wall = depth - FRONT - HANDLE, -(FRONT + HANDLE) / 2, height - 0.04 - floor
    model.block("gap", (body - 0.05, width - 0.06, plinth), (x - 0.025, 0, 0), solid=False)
    model.block("primary", (body, width, floor - 0.01 - plinth), (x, 0, plinth), solid=False)
    model.solid((depth, width, floor))
    walls: list[Block] = [((0.02, width, wall + 0.01), (x - (body - 0.02) / 2, 0, floor - 0.01))]
    walls += [((body, 0.02, wall + 0.01), (x, side * (width - 0.02) / 2, floor - 0.01)) for side in (-1, 1)]
    model.blocks("walls", "primary", walls)
    return x + body / 2


def _worktop(model: Model, size: Vector, centre: Span, hole: Span, well: Span, floor: float) -> None:
    """Add a worktop 4 cm thick with a hole for a basin.

    Args:
        model: model to add to.
        size: depth, width and height of the counter.
        centre: (x, y) of the hole.
        hole: depth and width of the visible hole.
        well: depth and width of what stays open between the solids; too narrow to put things in.
        floor: height from which the solids around the well rise.
    """
    height = size[2]
    flats = list(_around(size[0], size[1], centre, hole))
    model.blocks("worktop", "secondary", [((x, y, 0.04), (px, py, height - 0.04)) for x, y, px, py in flats])
    for x, y, px, py in _around(size[0], size[1], centre, well):
        model.solid((x, y, height - floor), (px, py, floor))


def _around(depth: float, width: float, centre: Span, hole: Span) -> Iterator[tuple[float, float, float, float]]:
    """Cut a rectangle with a hole into four: yield depth, width, x and y of each."""
    back, front = centre[0] - hole[0] / 2, centre[0] + hole[0] / 2
    right, left = centre[1] - hole[1] / 2, centre[1] + hole[1] / 2
    whole = (-depth / 2, depth / 2)
    for xs, ys in (
        (whole, (-width / 2, right)),
        (whole, (left, width / 2)),
        ((-depth / 2, back), (right, left)),
        ((front, depth / 2), (right, left)),
    ):
        yield xs[1] - xs[0], ys[1] - ys[0], sum(xs) / 2, sum(ys) / 2


def _tap(model: Model, at: Vector, height: float, reach: float) -> None:
    """Add a tap that reaches towards +x, with its solid column."""
    model.shape("tap", "dark_steel", tap_mesh(height, reach).moved(*at))
    model.solid((0.05, 0.05, height), at)


def tap_mesh(height: float, reach: float) -> Mesh:
    """Return a bent tap that stands on z = 0 and reaches towards +x, with a lever."""
    bend = [(0, 0, 0), (0, 0, height - 0.05), (0.04, 0, height - 0.016), (reach - 0.03, 0, height - 0.016)]
    spout = tube(np.array([*bend, (reach, 0, height - 0.07)]), 0.016, 6)
    return join(spout, box(0.02, 0.1, 0.02).moved(0, 0, 0.04))
