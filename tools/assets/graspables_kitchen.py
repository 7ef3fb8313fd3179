"""Tableware and cookware. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from tools.assets.decals import disc
from tools.assets.meshes import (
    Mesh,
    arc,
    box,
    cylinder,
    extrude,
    join,
    lathe,
    rounded_box,
    tube,
)
from tools.assets.model import Paint


def handle(reach: float, height: float, thickness: float) -> Mesh:
    """Return a D-shaped handle that starts at the z axis and reaches out along +x, centred on z = 0."""
    curve = arc(1.0, -np.pi / 2, np.pi / 2, 6) * [reach, height / 2]
    return tube(np.column_stack([curve[:, 0], np.zeros(7), curve[:, 1]]), thickness, 4)


def mug() -> Paint:
    """Mug, 9.5 cm high, with a handle and coffee inside."""
    lip = [(0.041, 0.076), (0.041, 0.095), (0.036, 0.095), (0.035, 0.078)]
    return {
        "teal": join(
            lathe([(0, 0), (0.036, 0), (0.040, 0.006), (0.041, 0.060)], 14),
            lathe(lip, 14),
            handle(0.032, 0.062, 0.0065).moved(0.038, 0, 0.048),
        ),
        "chocolate": disc(0.0356, 14).moved(z=0.080),
        "white": lathe([(0.041, 0.060), (0.041, 0.076)], 14),
    }


def glass() -> Paint:
    """Drinking glass, 12 cm high, with water inside."""
    return {
        "glass": join(
            lathe([(0, 0), (0.028, 0), (0.029, 0.014)], 12),
            lathe([(0.033, 0.080), (0.036, 0.125), (0.032, 0.125), (0.030, 0.078)], 12),
        ),
        "sky": join(disc(0.0305, 12).moved(z=0.080), lathe([(0.029, 0.014), (0.033, 0.080)], 12)),
    }


def wine_glass() -> Paint:
    """Stemmed glass, 20 cm high, with red wine."""
    foot = [(0, 0), (0.036, 0), (0.034, 0.004), (0.006, 0.010), (0.0045, 0.080), (0.010, 0.092)]
    wine = [(0.0105, 0.092), (0.030, 0.108), (0.039, 0.135), (0.0385, 0.146)]
    rim = [(0.0385, 0.146), (0.031, 0.195), (0.028, 0.195), (0.034, 0.148)]
    return {
        "ice": join(lathe(foot, 10), lathe(rim, 12)),
        "wine": join(lathe(wine, 12), disc(0.0345, 12).moved(z=0.148)),
    }


def bowl() -> Paint:
    """Soup bowl, 16 cm wide: blue outside, white inside."""
    return {
        "blue": lathe([(0, 0), (0.036, 0), (0.066, 0.028), (0.080, 0.065)], 14),
        "white": lathe([(0.080, 0.065), (0.075, 0.065), (0.060, 0.030), (0.034, 0.012), (0, 0.012)], 14),
    }


def plate() -> Paint:
    """Dinner plate, 26 cm wide, with a blue band."""
    return {
        "white": join(
            lathe([(0, 0), (0.075, 0), (0.130, 0.020), (0.126, 0.022)], 16),
            lathe([(0.112, 0.019), (0.080, 0.008), (0, 0.008)], 16),
        ),
        "blue": lathe([(0.126, 0.022), (0.112, 0.019)], 16),
    }


def fork() -> Paint:
    """Dinner fork, 23 cm long and broad, four tines, with a red grip."""
    tines = []
    for y in (0.0195, 0.0075, -0.0045, -0.0165):
        tines += [(0.052, y), (0.115, y - 0.001), (0.115, y - 0.005), (0.052, y - 0.006)]
    half = [(0.044, -0.0225), (0.026, -0.0205), (0.008, -0.0070), (-0.020, -0.0060)]
    clockwise = [*half, *((x, -y) for x, y in reversed(half)), *tines]
    return {
        "silver": extrude(clockwise[::-1], 0.007).turned("y", -0.08).moved(z=0.011),
        "red": rounded_box(0.110, 0.028, 0.020, 0.007).moved(-0.060),
    }


def knife() -> Paint:
    """Kitchen knife, 24 cm long, with a riveted black grip."""
    blade = [(-0.010, -0.024), (0.075, -0.024), (0.108, -0.012), (0.130, 0.016), (-0.010, 0.016)]
    return {
        "silver": extrude(blade, 0.010).moved(z=0.005),
        "black": rounded_box(0.105, 0.030, 0.022, 0.008).moved(-0.058),
        "gold": join(*(cylinder(0.0045, 0.002, 6).moved(x, 0, 0.0215) for x in (-0.092, -0.058, -0.024))),
    }


def frying_pan() -> Paint:
    """Frying pan, 20 cm wide, with a long handle."""
    grip = rounded_box(0.115, 0.026, 0.018, 0.007).turned("y", -0.12).moved(0.172, 0, 0.034)
    return {
        "charcoal": join(lathe([(0, 0), (0.080, 0), (0.100, 0.042), (0.095, 0.042)], 16), grip),
        "grey": lathe([(0.095, 0.042), (0.076, 0.008), (0, 0.008)], 16),
        "steel": box(0.030, 0.018, 0.010).turned("y", -0.12).moved(0.108, 0, 0.032),
    }


def cooking_pot() -> Paint:
    """Stew pot, 20 cm wide, with a lid and two handles."""
    ear = handle(0.034, 0.070, 0.007).turned("x", np.pi / 2).moved(0.096, 0, 0.095)
    return {
        "red": lathe([(0, 0), (0.094, 0), (0.100, 0.010), (0.100, 0.125)], 12),
        "silver": lathe([(0.104, 0.125), (0.104, 0.132), (0.060, 0.146), (0, 0.150)], 12),
        "black": join(ear, ear.turned("z", np.pi), cylinder(0.014, 0.022, 7, top=0.020).moved(z=0.149)),
    }


def coffee_pot() -> Paint:
    """Glass coffee jug, 19 cm high, half full, with a black lid, handle and spout."""
    coffee = [(0, 0), (0.058, 0), (0.068, 0.020), (0.068, 0.060), (0.062, 0.085)]
    spout = extrude([(-0.018, 0.0), (0.018, 0.0), (0.0, 0.030)], 0.028).turned("z", np.pi / 2).moved(-0.034, 0, 0.137)
    grip = tube(
        [(0.040, 0, 0.158), (0.092, 0, 0.160), (0.100, 0, 0.140), (0.094, 0, 0.070), (0.066, 0, 0.055)], 0.009, 5
    )
    return {
        "chocolate": lathe(coffee, 12),
        "glass": lathe([(0.062, 0.085), (0.042, 0.128), (0.042, 0.138)], 12),
        "black": join(lathe([(0.045, 0.136), (0.045, 0.165), (0.020, 0.172), (0, 0.172)], 12), spout, grip),
        "red": cylinder(0.010, 0.014, 7).moved(z=0.171),
    }


def washing_sponge() -> Paint:
    """Yellow sponge with a green scouring side."""
    big, small = ((-0.040, 0.018), (0.0, 0.010), (0.036, 0.014)), ((-0.022, -0.016), (0.020, -0.020), (0.042, -0.010))
    holes = [(x, y, radius) for radius, places in ((0.005, big), (0.004, small)) for x, y in places]
    top = [disc(radius, 6).moved(x, y, 0.041) for x, y, radius in holes]
    side = [disc(0.8 * radius, 6).turned("x", np.pi / 2).moved(x, -0.036, 0.024 + 0.3 * y) for x, y, radius in holes]
    return {
        "yellow": rounded_box(0.110, 0.070, 0.030, 0.006, bevel=0.003).moved(z=0.010),
        "green": rounded_box(0.110, 0.070, 0.012, 0.006, bevel=0),
        "gold": join(*top, *side),
    }
