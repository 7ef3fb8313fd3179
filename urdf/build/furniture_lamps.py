"""Slender standing things: lamps, plants and the coat rack."""

import numpy as np

from urdf.build.furniture_model import Model
from urdf.build.meshes import Mesh, cylinder, flipped, join, lathe, rounded_box, shaded, sphere, tube


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
    bow = [(0.02 + 0.12 * np.cos(a) - 0.0, 0, 1.46 + 0.13 * np.sin(a)) for a in angles]
    model.shape("pole", "secondary", tube([(-0.1, 0, 0.02), *bow], 0.014, 6))
    dome = lathe([(0.06, 0.12), (0.02, 0.14), (0.02, 0.12)], 12)
    bell = lathe([(0.0, 0.02), (0.1, 0), (0.09, 0.06), (0.03, 0.13), (0, 0.14)], 12)
    model.shape("shade", "primary", bell.moved(0.1, 0, 1.32))
    model.shape("bulb", "lampshade", sphere(0.05, 8, 4).moved(0.1, 0, 1.29))
    del dome
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
        lift: height of its middle over its base.
        droop: height of its tip under its middle.
        angle: direction about z.
    """
    base, tip = np.zeros(3), np.array([length, 0, lift - droop])
    left, right = np.array([0.55 * length, width / 2, lift]), np.array([0.55 * length, -width / 2, lift])
    spine = np.array([0.55 * length, 0, lift - 0.25 * width])
    triangles = np.array([[base, right, spine], [base, spine, left], [spine, right, tip], [left, spine, tip]])
    upper = shaded(triangles)
    return join(upper, flipped(upper)).turned("z", angle)


def _pot(radius: float, height: float) -> Mesh:
    return lathe([(0, 0), (0.72 * radius, 0), (radius, height), (0.88 * radius, height), (0.85 * radius, 0.85 * height)], 12)


def plant_tall() -> Model:
    """Return a tall house plant with broad leaves."""
    model = Model("plant_tall", primary="terracotta", secondary="leaf")
    model.shape("pot", "primary", _pot(0.18, 0.34))
    model.shape("soil", "soil", cylinder(0.15, 0.02, 12).moved(z=0.29))
    model.shape("stem", "walnut", tube([(0, 0, 0.3), (0.02, 0.01, 0.7), (0, 0, 1.15)], 0.018, 5))
    lower = [_leaf(0.25, 0.17, 0.14, 0.1, 0.2 + i * 1.2566).moved(z=0.6) for i in range(5)]
    middle = [_leaf(0.25, 0.17, 0.17, 0.08, 0.8 + i * 1.2566).moved(z=0.82) for i in range(5)]
    upper = [_leaf(0.2, 0.14, 0.24, 0.0, 0.2 + i * 1.5708).moved(z=1.1) for i in range(4)]
    model.shape("leaves", "secondary", *lower, *upper)
    model.shape("inner_leaves", "dark_leaf", *middle, _leaf(0.1, 0.1, 0.2, -0.1, 0.5).moved(z=1.1))
    model.solid_round(0.18, 0.34)
    model.solid_round(0.22, 0.8, (0, 0, 0.55))
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
    """Return a coat stand with a coat and a hat."""
    model = Model("coat_rack_pole", primary="walnut", secondary="navy")
    model.shape("pole", "primary", cylinder(0.022, 1.66, 6).moved(z=0.04))
    angles = np.pi / 4 + np.arange(4) * np.pi / 2
    feet = [tube([(0, 0, 0.12), (0.2 * np.cos(a), 0.2 * np.sin(a), 0.02)], 0.02, 4) for a in angles]
    hooks = [
        tube([(0, 0, 1.5), (0.1 * np.cos(a), 0.1 * np.sin(a), 1.5), (0.16 * np.cos(a), 0.16 * np.sin(a), 1.62)], 0.014, 4)
        for a in angles
    ]
    model.shape("arms", "primary", *feet, *hooks)
    model.shape("coat", "secondary", rounded_box(0.16, 0.3, 0.85, 0.06, bevel=0.04).moved(0.08, 0.06, 0.68))
    model.shape("hat", "mustard", lathe([(0.14, 0), (0.14, 0.015), (0.08, 0.02), (0.07, 0.1), (0, 0.11)], 10).moved(-0.1, -0.1, 1.55))
    model.solid_round(0.2, 0.12)
    model.solid_round(0.16, 1.02, (0, 0, 0.68))
    model.solid_round(0.04, 0.56, (0, 0, 0.12))
    return model
