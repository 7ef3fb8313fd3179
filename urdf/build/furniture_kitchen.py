"""Kitchen: counters, stoves, fridges, range hood, microwave and trash can."""

import numpy as np

from urdf.build.furniture_model import Block, Model, facing, tray
from urdf.build.furniture_storage import FRONT, HANDLE, carcass, fronts
from urdf.build.meshes import box, cylinder, extrude, join, lathe, loft, rectangle, rounded_rectangle, tube


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        _counter("kitchen_counter_straight", 0.62, 1.8, 3, "white", "oak"),
        kitchen_counter_sink(),
        _counter("kitchen_counter_short", 0.62, 1.0, 2, "white", "oak"),
        _counter("kitchen_counter_island", 0.8, 1.6, 3, "navy", "marble"),
        stove_gas(),
        stove_electric(),
        fridge_single(),
        fridge_double(),
        range_hood_steel(),
        microwave_steel(),
        trash_can_steel(),
    ]


def _counter(name: str, depth: float, width: float, columns: int, colour: str, top: str) -> Model:
    """Return a counter with doors under a row of drawers."""
    model = Model(name, primary=colour, secondary=top)
    x = carcass(model, (depth, width, 0.9), top=0.04, plinth=0.1)
    _counter_fronts(model, x, width, columns)
    return model


def _counter_fronts(model: Model, x: float, width: float, columns: int) -> None:
    fronts(model, x, (-width / 2, width / 2), (0.1, 0.66), columns, 1, "door", part="door_")
    fronts(model, x, (-width / 2, width / 2), (0.66, 0.86), columns, 1, "drawer", part="drawer_")


def kitchen_counter_sink() -> Model:
    """Return a counter with a steel sink in its left half and a free right half, seen from the front."""
    model = Model("kitchen_counter_sink", primary="white", secondary="oak")
    depth, width, body = 0.62, 1.8, 0.62 - FRONT - HANDLE
    x = -(FRONT + HANDLE) / 2
    model.block("gap", (body - 0.05, width - 0.06, 0.1), (x - 0.025, 0, 0), solid=False)
    model.block("primary", (body, width, 0.62), (x, 0, 0.1), solid=False)
    model.solid((depth, width, 0.72))
    fronts(model, x + body / 2, (-width / 2, width / 2), (0.1, 0.66), 3, 1, "door", part="door_")
    fronts(model, x + body / 2, (-width / 2, width / 2), (0.66, 0.86), 3, 1, "drawer", part="drawer_")
    walls = [((0.02, width, 0.14), (x + s * (body - 0.02) / 2, 0, 0.72)) for s in (-1, 1)]
    walls += [((body, 0.02, 0.14), (x, s * (width - 0.02) / 2, 0.72)) for s in (-1, 1)]
    model.blocks("walls", "primary", walls)
    worktop_with_hole(model, (depth, width), 0.9, 0.04, hole=(0.42, 0.6), centre=(0.02, 0.45), floor=0.72)
    basin = tray(rectangle(0.44, 0.62), rectangle(0.4, 0.58), 0.185, 0.01, 0.9)
    model.shape("sink", "steel", basin.moved(0.02, 0.45, 0.72))
    model.shape("tap", "dark_steel", tap(0.26, 0.18).moved(-0.23, 0.45, 0.9))
    model.solid((0.05, 0.05, 0.26), (-0.23, 0.45, 0.9))
    return model


def worktop_with_hole(
    model: Model,
    size: tuple[float, float],
    height: float,
    thick: float,
    hole: tuple[float, float],
    centre: tuple[float, float],
    floor: float,
) -> None:
    """Add a worktop with a rectangular hole, solid around the hole down to ``floor``.

    Args:
        model: model to add to.
        size: depth and width of the worktop.
        height: of its upper face.
        thick: its visible thickness.
        hole: depth and width of the hole.
        centre: centre of the hole.
        floor: height that the solid strips reach down to.
    """
    (depth, width), (cx, cy) = size, centre
    low, high = cy - hole[1] / 2, cy + hole[1] / 2
    back, front = cx - hole[0] / 2, cx + hole[0] / 2
    strips = [
        ((-depth / 2, depth / 2), (-width / 2, low)),
        ((-depth / 2, depth / 2), (high, width / 2)),
        ((-depth / 2, back), (low, high)),
        ((front, depth / 2), (low, high)),
    ]
    flats = [(xs[1] - xs[0], ys[1] - ys[0], sum(xs) / 2, sum(ys) / 2) for xs, ys in strips]
    model.blocks("worktop", "secondary", [((x, y, thick), (px, py, height - thick)) for x, y, px, py in flats])
    for x, y, px, py in flats:
        model.solid((x, y, height - floor), (px, py, floor))


def tap(height: float, reach: float):
    """Return a bent tap that reaches towards +x, with a lever."""
    bend = [(0, 0, 0), (0, 0, height - 0.05), (0.05, 0, height), (reach - 0.03, 0, height), (reach, 0, height - 0.06)]
    return join(tube(bend, 0.016, 6), box(0.02, 0.1, 0.02).moved(0, 0, 0.04))


def _stove(name: str, panel_colour: str) -> Model:
    """Return a cooker's body: oven door with window and bar, and a panel with five knobs."""
    model = Model(name, primary="white", secondary="black")
    depth, width, body = 0.62, 0.62, 0.58
    x, front = -0.02, 0.27
    model.block("gap", (body - 0.05, width - 0.04, 0.06), (x - 0.02, 0, 0), solid=False)
    model.block("primary", (body, width, 0.81), (x, 0, 0.06), solid=False)
    model.solid((depth, width, 0.9))
    model.block(panel_colour, (0.02, width, 0.12), (front + 0.01, 0, 0.75), solid=False)
    model.block("primary", (0.02, width - 0.03, 0.43), (front + 0.01, 0, 0.28), solid=False)
    model.block("screen", (0.01, 0.42, 0.24), (front + 0.02, 0, 0.35), solid=False)
    model.block("primary", (0.02, width - 0.03, 0.17), (front + 0.01, 0, 0.08), solid=False)
    bars: list[Block] = [((0.02, 0.46, 0.022), (front + 0.03, 0, z)) for z in (0.65, 0.2)]
    model.blocks("bars", "steel", bars)
    knobs = [facing(cylinder(0.024, 0.025, 8), front + 0.02, y, 0.81) for y in (-0.24, -0.14, 0.14, 0.24)]
    model.shape("knobs", "dark_steel", *knobs)
    model.block("screen", (0.006, 0.12, 0.05), (front + 0.021, 0, 0.785), solid=False)
    return model


#: Centres (x, y) and radii of the burners.
BURNERS = ((-0.16, -0.15, 0.1), (-0.16, 0.15, 0.08), (0.12, -0.15, 0.08), (0.12, 0.15, 0.1))


def stove_gas() -> Model:
    """Return a gas cooker: a steel top with four burners under flat grates."""
    model = Model("stove_gas", primary="white", secondary="steel")
    model = _stove("stove_gas", "steel")
    model.secondary = "steel"
    model.block("secondary", (0.6, 0.62, 0.03), (-0.01, 0, 0.868), solid=False)
    model.shape("burners", "black", *(cylinder(0.5 * r, 0.004, 10).moved(x, y, 0.897) for x, y, r in BURNERS))
    grates: list[Block] = []
    for x, y, radius in BURNERS:
        grates += [((2.2 * radius, 0.014, 0.004), (x, y, 0.899)), ((0.014, 2.2 * radius, 0.004), (x, y, 0.899))]
    model.blocks("grates", "charcoal", grates)
    return model


def stove_electric() -> Model:
    """Return an electric cooker: a black glass top with four marked hotplates."""
    model = _stove("stove_electric", "charcoal")
    model.block("secondary", (0.6, 0.62, 0.03), (-0.01, 0, 0.868), solid=False)
    rings = [
        lathe([(r, 0), (r, 0.004), (r - 0.02, 0.004), (r - 0.02, 0)], 14).moved(x, y, 0.897) for x, y, r in BURNERS
    ]
    model.shape("rings", "red", *rings)
    return model


def fridge_single() -> Model:
    """Return a fridge with a freezer door below."""
    model = Model("fridge_single", primary="white", secondary="dark_steel")
    _fridge(model, (0.65, 0.6, 1.75), [((-0.3, 0.3), (0.05, 0.6)), ((-0.3, 0.3), (0.6, 1.75))])
    model.blocks("handles", "secondary", [((0.03, 0.025, 0.3), (0.31, -0.23, z)) for z in (0.26, 0.68)])
    return model


def fridge_double() -> Model:
    """Return a steel fridge with two doors and a water dispenser."""
    model = Model("fridge_double", primary="steel", secondary="dark_steel")
    _fridge(model, (0.7, 0.9, 1.8), [((-0.45, 0.0), (0.05, 1.8)), ((0.0, 0.45), (0.05, 1.8))])
    model.blocks("handles", "secondary", [((0.03, 0.03, 0.8), (0.335, y, 0.6)) for y in (-0.06, 0.06)])
    model.block("screen", (0.008, 0.2, 0.3), (0.322, -0.26, 0.95), solid=False)
    model.block("water", (0.008, 0.12, 0.06), (0.328, -0.26, 1.17), solid=False)
    return model


def _fridge(model: Model, size: tuple[float, float, float], doors: list) -> None:
    depth, width, height = size
    x = depth / 2 - 0.03 - 0.05
    model.block("gap", (depth - 0.1, width - 0.02, height - 0.01), (-0.05 + 0.01, 0, 0), solid=False)
    model.block("primary", (depth - 0.09, width, height - 0.05), (-0.045, 0, 0.05), solid=False)
    gap = 0.014
    panels = [((0.05, y[1] - y[0] - gap, z[1] - z[0] - gap), (x + 0.025, sum(y) / 2, z[0] + gap / 2)) for y, z in doors]
    model.blocks("doors", "primary", panels)
    model.solid(size)


def range_hood_steel() -> Model:
    """Return a chimney hood that hangs on a wall; z = 0 is its lower edge."""
    model = Model("range_hood_steel", primary="steel", secondary="dark_steel")
    model.block("secondary", (0.5, 0.6, 0.05), (0, 0, 0))
    low, high = rectangle(0.5, 0.6), rectangle(0.22, 0.26) + np.array([-0.14, 0])
    model.shape("hood", "primary", loft([np.c_[low, np.full(4, 0.05)], np.c_[high, np.full(4, 0.22)]]))
    model.block("primary", (0.22, 0.26, 0.55), (-0.14, 0, 0.05))
    return model


def microwave_steel() -> Model:
    """Return a microwave oven with a dark window and a keypad."""
    model = Model("microwave_steel", primary="steel", secondary="dark_steel")
    model.block("primary", (0.33, 0.5, 0.29), (-0.015, 0, 0.01), solid=False)
    model.solid((0.36, 0.5, 0.3))
    model.block("screen", (0.01, 0.32, 0.21), (0.155, -0.07, 0.05), solid=False)
    model.block("charcoal", (0.01, 0.12, 0.26), (0.155, 0.18, 0.025), solid=False)
    model.block("secondary", (0.02, 0.02, 0.2), (0.17, 0.105, 0.055), solid=False)
    keys = [((0.004, 0.022, 0.022), (0.162, 0.15 + 0.03 * c, 0.05 + 0.035 * r)) for c in range(3) for r in range(4)]
    model.blocks("keys", "linen", keys)
    model.block("glass", (0.004, 0.09, 0.04), (0.162, 0.18, 0.22), solid=False)
    model.blocks("feet", "black", [((0.28, 0.04, 0.01), (-0.015, y, 0)) for y in (-0.2, 0.2)])
    return model


def trash_can_steel() -> Model:
    """Return a round pedal bin."""
    model = Model("trash_can_steel", primary="steel", secondary="charcoal")
    model.shape("can", "primary", cylinder(0.13, 0.42, 12).moved(z=0.03))
    model.shape("lid", "secondary", lathe([(0.138, 0.43), (0.138, 0.46), (0.1, 0.49), (0, 0.5)], 12))
    model.shape("foot", "secondary", cylinder(0.138, 0.035, 12))
    model.block("secondary", (0.05, 0.08, 0.02), (0.115, 0, 0.0), solid=False)
    model.solid_round(0.14, 0.5)
    return model
