"""Bathroom: towel racks, bathtub, shower, toilet, washing machine and laundry basket."""

import numpy as np

from tools.assets.furniture_counters import tap_mesh
from tools.assets.furniture_model import ROUND, Block, Model, ellipse, facing, leg, tray
from tools.assets.meshes import (
    box,
    cylinder,
    extrude,
    lathe,
    loft,
    rectangle,
    rounded_box,
    rounded_rectangle,
    shaded,
    tube,
)


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        towel_rack_shelf(),
        towel_rack_ladder(),
        bathtub_plain(),
        shower_glass(),
        toilet_white(),
        washing_machine_front(),
        laundry_basket_round(),
    ]


def towel_rack_shelf() -> Model:
    """Return a standing rack: a slatted shelf on top, a towel over a bar below."""
    model = Model("towel_rack_shelf", primary="oak", secondary="teal")
    depth, width, height = 0.3, 0.65, 1.05
    slats = [((0.045, width, 0.025), (-0.1275 + 0.051 * i, 0, height - 0.025)) for i in range(6)]
    model.blocks("slats", "primary", slats)
    model.solid((depth, width, 0.025), (0, 0, height - 0.025))
    posts: list[Block] = [((0.03, 0.03, height - 0.025), (x, y, 0)) for x in (-0.13, 0.13) for y in (-0.31, 0.31)]
    feet: list[Block] = [((0.23, 0.03, 0.03), (0, y, z)) for y in (-0.31, 0.31) for z in (0.1, 0.99)]
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
    depth, width, shelf = 0.36, 0.55, 0.97
    model.block("primary", (depth, width, 0.03), (0, 0, shelf))
    slope = np.array([0.155, -0.03])  # x of the front rails at the floor and at the shelf
    front = [leg((slope[0], y), (slope[1], y), (0, shelf), 0.04) for y in (-0.25, 0.25)]
    back = [box(0.035, 0.035, shelf).moved(-0.155, y) for y in (-0.25, 0.25)]
    heights = (0.2, 0.46, 0.76)
    spots = [float(np.interp(z, (0, shelf), slope)) for z in heights]
    rungs = [box(0.025, 0.5, 0.03).moved(x, 0, z) for x, z in zip(spots, heights, strict=True)]
    model.shape("rails", "primary", *front, *back, *rungs)
    for y in (-0.25, 0.25):
        model.solid((0.04, 0.04, shelf), (-0.155, y, 0))
        model.solid((0.12, 0.04, shelf), (0.06, y, 0))
    model.shape("towel", "secondary", rounded_box(0.07, 0.3, 0.33, 0.02).moved(spots[2], -0.06, 0.48))
    model.shape("towel_low", "cream", rounded_box(0.07, 0.26, 0.26, 0.02).moved(spots[1], 0.07, 0.235))
    model.solid((0.1, 0.44, 0.4), (0.06, 0, 0.4))
    return model


def bathtub_plain() -> Model:
    """Return a tub with water in it and a tap at its left end."""
    model = Model("bathtub_plain", primary="ceramic", secondary="water")
    outer, inner = rounded_rectangle(0.75, 1.6, 0.06, 1), rounded_rectangle(0.6, 1.42, 0.14, 1)
    model.shape("tub", "primary", tray(outer, inner, 0.55, 0.15, 0.85))
    model.shape("water", "secondary", extrude(0.94 * inner, 0.01).moved(z=0.36))
    model.shape("tap", "dark_steel", tap_mesh(0.18, 0.16).turned("z", -np.pi / 2).moved(0, 0.75, 0.55))
    model.solid((0.75, 1.6, 0.37))
    model.solid((0.05, 0.05, 0.18), (0, 0.75, 0.55))
    for side in (-1, 1):
        model.solid((0.075, 1.6, 0.18), (side * 0.3375, 0, 0.37))
        model.solid((0.75, 0.09, 0.18), (0, side * 0.755, 0.37))
    return model


def shower_glass() -> Model:
    """Return a corner shower: a tray with a drain, two glass walls, an open front and a shower head."""
    model = Model("shower_glass", primary="ceramic", secondary="dark_steel")
    model.shape("tray", "primary", tray(rectangle(0.9, 0.9), rectangle(0.8, 0.8), 0.1, 0.06, 0.97))
    model.solid((0.9, 0.9, 0.1))
    model.shape("drain", "secondary", cylinder(0.05, 0.006, 8).moved(z=0.06))
    model.block("glass", (0.02, 0.87, 1.87), (-0.44, 0, 0.1))
    model.block("glass", (0.87, 0.02, 1.87), (0, 0.44, 0.1))
    posts: list[Block] = [((0.03, 0.03, 1.87), (x, y, 0.1)) for x in (-0.435, 0.435) for y in (-0.435, 0.435)]
    rails: list[Block] = [((0.9, 0.03, 0.03), (0, y, 1.97)) for y in (-0.435, 0.435)]
    rails += [((0.03, 0.84, 0.03), (x, 0, 1.97)) for x in (-0.435, 0.435)]
    model.blocks("frame", "secondary", posts + rails, solid=True)
    pipe = tube([(-0.4, 0, 0.95), (-0.4, 0, 1.82), (-0.34, 0, 1.88), (-0.15, 0, 1.88)], 0.016, 5)
    head = lathe([(0, 0), (0.13, 0), (0.13, 0.02), (0.02, 0.06)], 10).moved(-0.13, 0, 1.81)
    model.shape("pipe", "charcoal", pipe, head, box(0.05, 0.24, 0.05).moved(-0.4, 0, 1.0))
    return model


def toilet_white() -> Model:
    """Return a toilet: bowl on a foot, seat ring, raised lid and cistern."""
    model = Model("toilet_white", primary="ceramic", secondary="white")
    rings = [(0.34, 0.26, -0.04, 0.0), (0.32, 0.24, -0.04, 0.12), (0.44, 0.34, 0.0, 0.32), (0.48, 0.38, 0.0, 0.4)]
    hollow = [(0.34, 0.24, 0.0, 0.4), (0.2, 0.14, 0.0, 0.26)]
    bowl = [np.column_stack([ellipse(x, y) + np.array([cx, 0]), np.full(ROUND, z)]) for x, y, cx, z in rings + hollow]
    model.shape("bowl", "primary", loft(bowl).moved(0.1))
    seat = [np.column_stack([ellipse(x, y), np.full(ROUND, z)]) for x, y, z in SEAT]
    model.shape("seat", "secondary", loft(seat, caps=False).moved(0.1))
    lid = rounded_box(0.38, 0.36, 0.025, 0.1, bevel=0.005).turned("y", -np.pi / 2)
    model.shape("lid", "secondary", lid.moved(-0.13, 0, 0.6))
    model.shape("tank", "primary", rounded_box(0.18, 0.38, 0.36, 0.03, bevel=0.015).moved(-0.25, 0, 0.4))
    model.block("primary", (0.2, 0.26, 0.4), (-0.22, 0, 0), solid=False)
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
    """Return a woven basket of two straws with laundry looking out."""
    model = Model("laundry_basket_round", primary="pine", secondary="cream")
    rings = [[(0.155 + 0.07 * z) * np.array([np.cos(a), np.sin(a), 0]) + [0, 0, z] for a in WEAVE] for z in LAYERS]
    wall = loft(rings, caps=False).triangles.reshape(2, len(LAYERS) - 1, len(WEAVE), 3, 3)
    odd = np.add.outer(np.arange(len(LAYERS) - 1), np.arange(len(WEAVE))) % 2 == 1
    faces = wall.transpose(1, 2, 0, 3, 4)
    model.shape("straw", "primary", shaded(faces[~odd].reshape(-1, 3, 3)))
    model.shape("dark_straw", "oak", shaded(faces[odd].reshape(-1, 3, 3)))
    model.shape("rim", "oak", lathe([(0.188, 0.44), (0.2, 0.45), (0.2, 0.48), (0.17, 0.48), (0.16, 0.42)], 12))
    heap = lathe([(0.168, 0.44), (0.15, 0.5), (0.08, 0.54), (0, 0.55)], 8)
    model.shape("laundry", "secondary", heap)
    model.shape("shirt", "blue", rounded_box(0.2, 0.14, 0.06, 0.02).moved(0.05, 0.04, 0.483))
    model.shape("sock", "red", rounded_box(0.07, 0.2, 0.05, 0.02).turned("z", 0.5).moved(-0.08, -0.05, 0.48))
    model.solid_round(0.2, 0.55)
    return model


#: Angles and heights of the laundry basket's weave.
WEAVE = np.arange(14) * np.pi / 7
LAYERS = (0.0, 0.09, 0.18, 0.27, 0.36, 0.45)
