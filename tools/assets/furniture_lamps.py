"""Slender standing things: lamps, plants and the coat rack."""

import numpy as np

from tools.assets.furniture_model import Model, leg, panel
from tools.assets.meshes import Mesh, cylinder, flipped, join, lathe, shaded, sphere, tube


def models() -> list[Model]:
    """Return the models of this group."""
    return [floor_lamp_arc(), floor_lamp_shade(), table_lamp_shade(), plant_tall(), plant_small(), coat_rack_pole()]


def _shade(low: float, high: float, height: float) -> Mesh:
    """Return a lampshade with a closed top."""
    return cylinder(low, height, 14, top=high)


def floor_lamp_shade() -> Model:
    """Return a standard lamp with a cloth shade."""
    model = Model("floor_lamp_shade", primary="lampshade", secondary="walnut")
    model.shape("foot", "secondary", cylinder(0.15, 0.03, 12))
    model.shape("pole", "secondary", cylinder(0.018, 1.3, 6).moved(z=0.02))
    model.shape("shade", "primary", _shade(0.2, 0.14, 0.32).moved(z=1.28))
    model.solid_round(0.15, 0.03)
    model.solid_round(0.03, 1.25, (0, 0, 0.03))
    model.solid_round(0.2, 0.32, (0, 0, 1.28))
    return model


def floor_lamp_arc() -> Model:
    """Return an arc lamp that bends forwards."""
    model = Model("floor_lamp_arc", primary="brass", secondary="charcoal")
    model.shape("foot", "secondary", cylinder(0.12, 0.03, 12).moved(-0.08))
    angles = np.linspace(np.pi, 0.1, 7)
    bow = [(0.02 + 0.12 * np.cos(a), 0, 1.46 + 0.13 * np.sin(a)) for a in angles]
    model.shape("pole", "secondary", tube([(-0.1, 0, 0.02), *bow], 0.014, 6))
    bell = lathe([(0.0, 0.02), (0.1, 0), (0.09, 0.06), (0.03, 0.13), (0, 0.14)], 12)
    model.shape("shade", "primary", bell.moved(0.1, 0, 1.32))
    model.shape("bulb", "lampshade", sphere(0.05, 8, 4).moved(0.1, 0, 1.29))
    model.solid_round(0.12, 0.03, (-0.08, 0, 0))
    model.solid_round(0.02, 1.5, (-0.1, 0, 0.03))
    model.solid((0.3, 0.2, 0.3), (0.05, 0, 1.3))
    return model


def table_lamp_shade() -> Model:
    """Return a table lamp with a ceramic belly."""
    model = Model("table_lamp_shade", primary="lampshade", secondary="teal")
    belly = [(0.0, 0.0), (0.06, 0.0), (0.085, 0.07), (0.06, 0.15), (0.02, 0.2), (0.015, 0.26)]
    model.shape("foot", "secondary", lathe(belly, 12))
    model.shape("shade", "primary", _shade(0.13, 0.09, 0.21).moved(z=0.24))
    model.solid_round(0.085, 0.24)
    model.solid_round(0.13, 0.21, (0, 0, 0.24))
    return model


def _leaf(length: float, width: float, lift: float, droop: float, angle: float) -> Mesh:
    """Return a curved two-sided leaf from the origin outwards.

    Args:
        length: reach sideways.
        width: greatest width.
        lift: greatest height over its base.
        droop: height of its tip under that.
        angle: direction about z.
    """
    near, far = (0.32 * length, width / 2, 0.65 * lift), (0.72 * length, 0.42 * width, lift)
    base, tip = (0.0, 0.0, 0.0), (length, 0.0, lift - droop)
    near_right, far_right = (near[0], -near[1], near[2]), (far[0], -far[1], far[2])
    faces = [(base, near_right, near), (near, near_right, far_right), (near, far_right, far), (far, far_right, tip)]
    upper = shaded(np.array(faces))
    return join(upper, flipped(upper)).turned("z", angle)


def _pot(radius: float, height: float) -> Mesh:
    """Return a flower pot, open at the top."""
    rim = [(radius, height), (0.88 * radius, height), (0.85 * radius, 0.85 * height)]
    return lathe([(0, 0), (0.72 * radius, 0), *rim], 12)


def plant_tall() -> Model:
    """Return a tall house plant with broad leaves."""
    model = Model("plant_tall", primary="terracotta", secondary="leaf")
    model.shape("pot", "primary", _pot(0.18, 0.34))
    model.shape("soil", "soil", cylinder(0.15, 0.02, 12).moved(z=0.29))
    model.shape("stem", "walnut", tube([(0, 0, 0.3), (0.02, 0.01, 0.7), (0, 0, 1.15)], 0.018, 5))
    leaves = [
        _leaf(0.25 - 0.008 * i, 0.19, 0.11 + 0.008 * i, 0.03, 2.4 * i).moved(z=0.45 + 0.05 * i) for i in range(15)
    ]
    crown = [_leaf(0.08, 0.12, 0.17, -0.08, i * 2.1).moved(z=1.15) for i in range(3)]
    model.shape("leaves", "secondary", *leaves[::2], *crown)
    model.shape("inner_leaves", "dark_leaf", *leaves[1::2])
    model.solid_round(0.18, 0.34)
    model.solid_round(0.22, 0.92, (0, 0, 0.48))
    return model


def plant_small() -> Model:
    """Return a small plant in a white pot."""
    model = Model("plant_small", primary="white", secondary="leaf")
    model.shape("pot", "primary", _pot(0.085, 0.15))
    model.shape("soil", "soil", cylinder(0.07, 0.01, 10).moved(z=0.125))
    outer = [_leaf(0.125, 0.08, 0.13, 0.05, i * 1.0472).moved(z=0.13) for i in range(6)]
    inner = [_leaf(0.07, 0.07, 0.17, -0.1, 0.5 + i * 1.5708).moved(z=0.13) for i in range(4)]
    model.shape("leaves", "secondary", *outer)
    model.shape("inner_leaves", "dark_leaf", *inner)
    model.solid_round(0.085, 0.15)
    model.solid_round(0.1, 0.25, (0, 0, 0.15))
    return model


def coat_rack_pole() -> Model:
    """Return a coat stand with a coat and a hat on its hooks."""
    model = Model("coat_rack_pole", primary="walnut", secondary="burgundy")
    around = [(np.cos(a), np.sin(a)) for a in np.pi / 4 + np.arange(4) * np.pi / 2]
    feet = [leg((0.18 * x, 0.18 * y), (0, 0), (0, 0.16), 0.036) for x, y in around]
    hooks = [leg((0.01 * x, 0.01 * y), (0.15 * x, 0.15 * y), (1.42, 1.6), 0.028) for x, y in around]
    model.shape("pole", "primary", cylinder(0.024, 1.66, 6).moved(z=0.04), *feet, *hooks)
    coat = panel(COAT, 0.05, 0.12)
    model.shape("coat", "secondary", coat)
    model.block("charcoal", (0.004, 0.012, 0.62), (0.172, 0, 0.66), solid=False)
    model.blocks("buttons", "brass", [((0.008, 0.025, 0.025), (0.174, -0.03, z)) for z in (0.85, 1.0, 1.15)])
    model.shape("scarf", "cream", panel([(-0.06, 1.34), (0, 1.27), (0.06, 1.34), (0, 1.4)], 0.165, 0.012))
    hat = lathe([(0, 0), (0.13, 0), (0.13, 0.015), (0.08, 0.02), (0.07, 0.1), (0, 0.11)], 10)
    model.shape("hat", "mustard", hat.moved(-0.06, -0.03, 1.59))
    model.solid((0.396, 0.396, 0.1))
    model.solid((0.14, 0.4, 0.85), (0.11, 0, 0.6))
    model.solid_round(0.13, 0.3, (-0.06, -0.03, 1.4))
    model.solid_round(0.04, 1.3, (0, 0, 0.1))
    return model


#: Outline (y, z) of a hanging coat, counterclockwise from its hem.
COAT = (
    (-0.15, 0.62),
    (0.15, 0.62),
    (0.11, 1.14),
    (0.15, 0.85),
    (0.2, 0.87),
    (0.17, 1.3),
    (0.06, 1.4),
    (-0.06, 1.4),
    (-0.17, 1.3),
    (-0.2, 0.87),
    (-0.15, 0.85),
    (-0.11, 1.14),
)
