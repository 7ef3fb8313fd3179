"""Bathroom: counters, towel racks, bathtub, shower, toilet, washing machine and laundry basket."""

import numpy as np

from urdf.build.furniture_kitchen import tap, worktop_with_hole
from urdf.build.furniture_model import Model, ellipse, facing, tray
from urdf.build.furniture_storage import FRONT, HANDLE, fronts
from urdf.build.meshes import cylinder, lathe, loft, rounded_box, rounded_rectangle, tube


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        _bathroom_counter("bathroom_counter_single", (0.5, 0.9, 0.85), basin_y=0.22, colour="white", top="oak"),
        _bathroom_counter("bathroom_counter_double", (0.52, 1.4, 0.85), basin_y=0.42, colour="oak", top="marble"),
        towel_rack_shelf(),
        towel_rack_ladder(),
        bathtub_plain(),
        shower_glass(),
        toilet_white(),
        washing_machine_front(),
        laundry_basket_round(),
    ]


def _bathroom_counter(
    name: str, size: tuple[float, float, float], basin_y: float, colour: str, top: str
) -> Model:
    """Return a vanity: doors below, a sunk basin with a tap on the left, free top on the right."""
    model = Model(name, primary=colour, secondary=top)
    depth, width, height = size
    body, x, floor = depth - FRONT - HANDLE, -(FRONT + HANDLE) / 2, height - 0.14
    model.block("gap", (body - 0.05, width - 0.06, 0.1), (x - 0.025, 0, 0), solid=False)
    model.block("primary", (body, width, height - 0.24), (x, 0, 0.1), solid=False)
    model.solid((depth, width, floor))
    columns = 2 if width < 1.2 else 3
    fronts(model, x + body / 2, (-width / 2, width / 2), (0.1, height - 0.035), columns, 1, "door")
    walls = [((0.02, width, 0.105), (x + s * (body - 0.02) / 2, 0, floor)) for s in (-1, 1)]
    walls += [((body, 0.02, 0.105), (x, s * (width - 0.02) / 2, floor)) for s in (-1, 1)]
    model.blocks("walls", "primary", walls)
    worktop_with_hole(model, (depth, width), height, 0.035, (0.32, 0.4), (0.04, basin_y), floor)
    outer = rounded_rectangle(0.36, 0.44, 0.08, 1)
    inner = rounded_rectangle(0.3, 0.38, 0.07, 1)
    model.shape("basin", "ceramic", tray(outer, inner, 0.145, 0.01, 0.75).moved(0.04, basin_y, floor))
    model.shape("tap", "dark_steel", tap(0.17, 0.13).moved(0.06 - depth / 2, basin_y, height))
    model.solid((0.05, 0.05, 0.17), (0.06 - depth / 2, basin_y, height))
    return model


def towel_rack_shelf() -> Model:
    """Return a standing rack: a slatted shelf on top, a towel over a bar below."""
    model = Model("towel_rack_shelf", primary="oak", secondary="teal")
    depth, width, height = 0.3, 0.65, 1.05
    slats = [((0.045, width, 0.025), (-0.1275 + 0.051 * i, 0, height - 0.025)) for i in range(6)]
    model.blocks("slats", "primary", slats)
    model.solid((depth, width, 0.025), (0, 0, height - 0.025))
    posts = [((0.03, 0.03, height - 0.025), (x, y, 0)) for x in (-0.13, 0.13) for y in (-0.31, 0.31)]
    feet = [((0.23, 0.03, 0.03), (0, y, z)) for y in (-0.31, 0.31) for z in (0.1, 0.99)]
    model.blocks("posts", "primary", posts + feet)
    for y in (-0.31, 0.31):
        model.solid((0.29, 0.03, height - 0.025), (0, y, 0))
    model.blocks("bars", "dark_steel", [((0.02, 0.6, 0.02), (0.04, 0, 0.82)), ((0.02, 0.6, 0.02), (0, 0, 0.2))])
    model.shape("towel", "secondary", rounded_box(0.06, 0.42, 0.45, 0.02).moved(0.04, 0, 0.4))
    model.blocks("stripes", "cream", [((0.066, 0.424, 0.03), (0.04, 0, z)) for z in (0.46, 0.52)])
    model.solid((0.06, 0.6, 0.45), (0.04, 0, 0.4))
    return model


def towel_rack_ladder() -> Model:
    """Return a wooden ladder rack with a shelf on top and two hanging towels."""
    model = Model("towel_rack_ladder", primary="birch", secondary="rose")
    depth, width = 0.36, 0.55
    model.block("primary", (depth, width, 0.03), (0, 0, 0.97))
    rails = []
    for y in (-0.25, 0.25):
        rails += [tube([(0.15, y, 0), (-0.02, y, 0.97)], 0.022, 4), tube([(-0.155, y, 0), (-0.155, y, 0.97)], 0.02, 4)]
    model.shape("rails", "primary", *rails)
    rungs = [tube([(x, -0.25, z), (x, 0.25, z)], 0.014, 5) for x, z in ((0.107, 0.22), (0.062, 0.48), (0.016, 0.74))]
    model.shape("rungs", "primary", *rungs)
    for y in (-0.25, 0.25):
        model.solid((0.05, 0.04, 0.97), (-0.15, y, 0))
        model.solid((0.1, 0.04, 0.97), (0.06, y, 0))
    model.shape("towel", "secondary", rounded_box(0.05, 0.3, 0.36, 0.015).moved(0.02, -0.06, 0.4))
    model.shape("towel_low", "cream", rounded_box(0.05, 0.26, 0.3, 0.015).moved(0.11, 0.08, 0.2 - 0.26 + 0.0 + 0.0 + 0.0 + 0.0 + 0.0 + 0.0 + 0.0 + 0.0 + 0.12))
    return model


def bathtub_plain() -> Model:
    """Return a tub with water in it and a tap at its left end."""
    model = Model("bathtub_plain", primary="ceramic", secondary="water")
    outer, inner = rounded_rectangle(0.75, 1.6, 0.06, 1), rounded_rectangle(0.6, 1.42, 0.14, 1)
    model.shape("tub", "primary", tray(outer, inner, 0.55, 0.15, 0.85))
    model.shape("water", "secondary", cylinder(1, 0.001, 4).scaled(0.01, 0.01, 1).moved(z=0.15))
    model.shape("tap", "dark_steel", tap(0.16, 0.14).turned("z", -np.pi / 2).moved(0, 0.76, 0.55))
    model.solid((0.75, 1.6, 0.16))
    for side in (-1, 1):
        model.solid((0.075, 1.6, 0.55), (side * 0.3375, 0, 0))
        model.solid((0.75, 0.09, 0.55), (0, side * 0.755, 0))
    return model


def shower_glass() -> Model:
    """Return a corner shower with a tray, glass frames and a shower head."""
    model = Model("shower_glass", primary="ceramic", secondary="dark_steel")
    model.block("primary", (0.9, 0.9, 0.08))
    model.block("glass", (0.02, 0.9, 1.9), (-0.44, 0, 0.08))
    posts = [((0.03, 0.03, 1.92), (x, y, 0.08)) for x in (-0.435, 0.435) for y in (-0.435, 0.435)]
    rails = [((0.9, 0.03, 0.03), (0, y, 1.97)) for y in (-0.435, 0.435)]
    rails += [((0.03, 0.9, 0.03), (x, 0, 1.97)) for x in (-0.435, 0.435)]
    model.blocks("frame", "secondary", posts + rails, solid=True)
    pipe = tube([(-0.4, 0, 1.0), (-0.4, 0, 1.85), (-0.36, 0, 1.9), (-0.2, 0, 1.9)], 0.014, 5)
    head = lathe([(0, 0), (0.1, 0), (0.1, 0.02), (0.02, 0.04)], 10).moved(-0.18, 0, 1.86)
    model.shape("pipe", "dark_steel", pipe, head)
    return model


def toilet_white() -> Model:
    """Return a toilet: bowl on a foot, seat ring, raised lid and cistern."""
    model = Model("toilet_white", primary="ceramic", secondary="white")
    rings = [(0.3, 0.24, -0.02, 0.0), (0.28, 0.2, -0.02, 0.12), (0.44, 0.34, 0.0, 0.32), (0.48, 0.38, 0.0, 0.4)]
    hollow = [(0.34, 0.24, 0.0, 0.4), (0.2, 0.14, 0.0, 0.26)]
    bowl = [np.column_stack([ellipse(x, y) + [cx, 0], np.full(12, z)]) for x, y, cx, z in rings + hollow]
    model.shape("bowl", "primary", loft(bowl).moved(0.1))
    seat = [np.column_stack([ellipse(x, y), np.full(12, z)]) for x, y, z in SEAT]
    model.shape("seat", "secondary", loft(seat, caps=False).moved(0.1))
    lid = rounded_box(0.38, 0.36, 0.025, 0.1, bevel=0.005).turned("y", -np.pi / 2)
    model.shape("lid", "secondary", lid.moved(-0.13, 0, 0.6))
    model.shape("tank", "primary", rounded_box(0.18, 0.38, 0.36, 0.03, bevel=0.015).moved(-0.25, 0, 0.4))
    model.block("primary", (0.2, 0.2, 0.4), (-0.22, 0, 0), solid=False)
    model.block("secondary", (0.19, 0.39, 0.025), (-0.245, 0, 0.745), solid=False)
    model.block("steel", (0.05, 0.08, 0.01), (-0.25, 0, 0.77), solid=False)
    model.solid((0.18, 0.38, 0.78), (-0.25, 0, 0))
    model.solid((0.5, 0.36, 0.42), (0.09, 0, 0))
    return model


#: Ellipses (x, y, z) of the toilet seat's ring, from its outer lower edge over the top to its inner edge.
SEAT = ((0.48, 0.38, 0.4), (0.48, 0.38, 0.42), (0.32, 0.22, 0.42), (0.32, 0.22, 0.39))


def washing_machine_front() -> Model:
    """Return a front loader with a round door."""
    model = Model("washing_machine_front", primary="white", secondary="dark_steel")
    model.block("primary", (0.55, 0.6, 0.83), (-0.025, 0, 0.02), solid=False)
    model.block("gap", (0.5, 0.56, 0.02), (-0.025, 0, 0), solid=False)
    model.solid((0.6, 0.6, 0.85))
    ring = lathe([(0.2, 0), (0.19, 0.04), (0.14, 0.045), (0.13, 0.02)], 16)
    model.shape("ring", "secondary", facing(ring, 0.25, 0, 0.4))
    glass = lathe([(0.14, 0.0), (0.13, 0.025), (0.08, 0.045), (0, 0.05)], 16)
    model.shape("door", "screen", facing(glass, 0.25, 0, 0.4))
    model.block("grey", (0.008, 0.58, 0.11), (0.253, 0, 0.72), solid=False)
    model.block("primary", (0.012, 0.2, 0.08), (0.257, -0.17, 0.735), solid=False)
    model.shape("dial", "secondary", facing(cylinder(0.035, 0.03, 10), 0.257, 0.02, 0.775))
    model.block("screen", (0.006, 0.14, 0.05), (0.259, 0.18, 0.75), solid=False)
    return model


def laundry_basket_round() -> Model:
    """Return a wicker basket with laundry looking out."""
    model = Model("laundry_basket_round", primary="pine", secondary="cream")
    profile = [(0.15, 0), (0.2, 0.5), (0.2, 0.53), (0.185, 0.53), (0.17, 0.4)]
    model.shape("basket", "primary", lathe(profile, 12))
    bands = [lathe([(r, z), (r + 0.004, z + 0.02), (r, z + 0.04)], 12) for r, z in ((0.164, 0.12), (0.18, 0.28), (0.194, 0.42))]
    model.shape("bands", "oak", *bands)
    model.shape("laundry", "secondary", lathe([(0.17, 0.46), (0.15, 0.52), (0.08, 0.545), (0, 0.55)], 8))
    model.shape("sock", "blue", rounded_box(0.16, 0.12, 0.05, 0.02).moved(0.04, 0.05, 0.5))
    model.solid_round(0.2, 0.55)
    return model
