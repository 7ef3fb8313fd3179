"""Kitchen: stoves, fridges, range hood, microwave and trash can."""

import numpy as np

from tools.assets.furniture_model import Block, Model, Vector, facing
from tools.assets.furniture_storage import Span
from tools.assets.meshes import cylinder, lathe, loft, rectangle


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        stove_gas(),
        stove_electric(),
        fridge_single(),
        fridge_double(),
        range_hood_steel(),
        microwave_steel(),
        trash_can_steel(),
    ]


#: Centres (x, y) and radii of a stove's burners.
BURNERS = ((-0.16, -0.15, 0.11), (-0.16, 0.15, 0.085), (0.11, -0.15, 0.085), (0.11, 0.15, 0.11))


def _stove(name: str, top: str, strip: str) -> Model:
    """Return a cooker without burners: oven door with window and bar, a strip of four knobs, flat top at 0.9 m."""
    model = Model(name, primary="white", secondary=top)
    width, front = 0.62, 0.26
    model.block("gap", (0.52, width - 0.04, 0.06), (-0.04, 0, 0), solid=False)
    model.block("primary", (0.57, width, 0.81), (-0.025, 0, 0.06), solid=False)
    model.block("secondary", (0.6, width, 0.03), (-0.01, 0, 0.87), solid=False)
    model.solid((0.62, width, 0.9))
    model.block(strip, (0.02, width, 0.12), (front + 0.01, 0, 0.75), solid=False)
    panels = [((0.02, width - 0.03, tall), (front + 0.01, 0, z)) for z, tall in ((0.28, 0.44), (0.08, 0.18))]
    model.blocks("doors", "primary", panels)
    model.block("screen", (0.008, 0.42, 0.24), (front + 0.022, 0, 0.35), solid=False)
    model.blocks("bars", "dark_steel", [((0.03, 0.46, 0.022), (front + 0.035, 0, z)) for z in (0.66, 0.21)])
    knob = lathe([(0.026, 0), (0.022, 0.028), (0, 0.03)], 6)
    knobs = (facing(knob, front + 0.02, y, 0.81) for y in (-0.25, -0.16, 0.16, 0.25))
    model.shape("knobs", "black" if strip == "steel" else "steel", *knobs)
    model.block("screen", (0.006, 0.14, 0.05), (front + 0.021, 0, 0.785), solid=False)
    return model


def stove_gas() -> Model:
    """Return a gas cooker: a steel top with four burners under flat grates."""
    model = _stove("stove_gas", "steel", "steel")
    burner = lathe([(0.5, 0.0), (0.5, 0.004), (0.0, 0.004)], 8)
    model.shape("burners", "charcoal", *(burner.scaled(r, r, 1).moved(x, y, 0.9) for x, y, r in BURNERS))
    grates: list[Block] = []
    for x, y, radius in BURNERS:
        grates += [((2.2 * radius, 0.016, 0.008), (x, y, 0.9)), ((0.016, 2.2 * radius, 0.008), (x, y, 0.9))]
    model.blocks("grates", "black", grates)
    return model


def stove_electric() -> Model:
    """Return an electric cooker: a black glass top with four marked hotplates."""
    model = _stove("stove_electric", "black", "charcoal")
    ring = lathe([(1.0, 0.005), (0.82, 0.005)], 12)
    model.shape("rings", "red", *(ring.scaled(r, r, 1).moved(x, y, 0.9) for x, y, r in BURNERS))
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


def _fridge(model: Model, size: Vector, doors: list[tuple[Span, Span]]) -> None:
    """Add a body of size (depth, width, height) with doors over the given (y, z) extents."""
    depth, width, height = size
    x = depth / 2 - 0.03 - 0.05
    model.block("gap", (depth - 0.1, width - 0.02, height - 0.01), (-0.04, 0, 0), solid=False)
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
