"""Food and drink. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from tools.assets.decals import GAP, bent, both, climbing, disc, front, lettering, panel, patch
from tools.assets.meshes import (
    Mesh,
    arc,
    at_height,
    box,
    cylinder,
    extrude,
    join,
    lathe,
    loft,
    ngon,
    rectangle,
    sphere,
    tube,
)
from tools.assets.model import Paint


def leaf(length: float, width: float) -> Mesh:
    """Return a folded leaf from the origin along +x, seen from both sides."""
    half = length / 2
    points = np.array([[0, 0, 0], [half, -width / 2, 0.15 * length], [length, 0, 0], [half, width / 2, 0.15 * length]])
    thickness = np.array([0, 0, 0.002])
    return loft([points, points + thickness])


def apple() -> Paint:
    """Red apple, 9 cm across, with stem and leaf."""
    profile = [(0, 0.006), (0.018, 0), (0.036, 0.013), (0.045, 0.043), (0.042, 0.065), (0.025, 0.082), (0, 0.071)]
    return {
        "red": lathe(profile, 12, crease=np.radians(70)),
        "brown": tube([(0, 0, 0.066), (0.002, 0, 0.082), (0.007, 0, 0.094)], 0.0028, 5),
        "green": leaf(0.034, 0.020).turned("y", -0.35).moved(0.003, 0, 0.082),
    }


def banana() -> Paint:
    """Curved banana, 21 cm long, lying on its side."""
    angles = np.linspace(0.25 * np.pi, 0.75 * np.pi, 8)
    path = np.column_stack([0.125 * np.cos(angles), 0.125 * np.sin(angles), np.full(8, 0.019)])
    radii = (0.008, 0.015, 0.019, 0.020, 0.020, 0.019, 0.014, 0.006)
    stalk = path[-1] + [[0, 0, 0], [-0.008, -0.009, 0], [-0.014, -0.020, 0.001]]
    tip = path[0] + [[0, 0, 0], [0.004, -0.005, 0]]
    return {
        "yellow": join(tube(path, radii, 6), tube(stalk, 0.006, 6)),
        "brown": join(tube(tip, (0.008, 0.005), 6), tube(stalk[-1] + [[0, 0, 0], [-0.003, -0.006, 0]], 0.0065, 6)),
    }


def bread() -> Paint:
    """Tin loaf, 24 cm long, scored across its top."""
    half = np.array([(0.042, 0.0), (0.048, 0.055), (0.053, 0.075), (0.040, 0.096)])
    outline = np.concatenate([half, [(0, 0.106)], half[::-1] * [-1, 1]])
    ends = ((-0.12, 0.86), (-0.108, 1.0), (0.108, 1.0), (0.12, 0.86))
    rings = [np.column_stack([np.full(9, x), outline * [scale, (1 + scale) / 2]]) for x, scale in ends]
    score = extrude(ngon(1.0, 6) * [0.040, 0.012], 0.008, top=0.3).turned("z", np.pi / 2 - 0.5)
    return {
        "crust": loft(rings, crease=np.radians(50)),
        "cream": join(*(score.moved(x, 0, 0.099) for x in (-0.075, -0.025, 0.025, 0.075))),
    }


def cupcake() -> Paint:
    """Cupcake, 8 cm wide: pleated case, pink frosting, a cherry."""
    pleats = np.where(np.arange(20) % 2, 0.93, 1.0)[:, None] * ngon(1.0, 20)
    case = loft([at_height(0.026 * pleats, 0), at_height(0.038 * pleats, 0.040)], caps=False, crease=0.1)
    frosting = [(0.036, 0.038), (0.044, 0.046), (0.034, 0.058), (0.033, 0.064), (0.022, 0.073), (0, 0.084)]
    sprinkle = tube([(0, -0.005, 0), (0, 0.005, 0)], 0.002, 3)
    places = ((0.037, 0.054, 3.6), (0.027, 0.069, 4.3), (0.037, 0.054, 5.0), (0.027, 0.069, 5.8), (0.037, 0.054, 0.5))
    return {
        "teal": case,
        "pink": lathe(frosting, 12, crease=np.radians(50)),
        "red": sphere(0.011, 7, 4).moved(z=0.078),
        "yellow": join(*(sprinkle.turned("z", 2 * a).moved(r * np.cos(a), r * np.sin(a), z) for r, z, a in places)),
    }


def lime() -> Paint:
    """Lime, 8 cm long, with a nub at both ends, lying on its side."""
    half = [(0.006, 0.002), (0.010, 0.008), (0.026, 0.018), (0.033, 0.036)]
    profile = [(0, 0), *half, (0.027, 0.058), (0.010, 0.071), (0.005, 0.079), (0, 0.080)]
    fruit = lathe(profile, 12, crease=np.radians(75)).turned("y", np.pi / 2).moved(z=0.033)
    return {
        "lime": fruit,
        "brown": cylinder(0.005, 0.005, 6).turned("y", -np.pi / 2).moved(0.002, 0, 0.033),
        "green": leaf(0.044, 0.024).turned("y", -1.15).moved(0.002, 0, 0.035),
    }


def peach() -> Paint:
    """Ripe peach, 8 cm across: blushed cheek, cleft, leaf."""
    profile = [(0, 0.003), (0.016, 0), (0.034, 0.016), (0.040, 0.038), (0.034, 0.060), (0.016, 0.073), (0, 0.068)]
    fruit = lathe(profile, 12, crease=np.radians(70))
    middle = fruit.triangles.mean(axis=1)
    cheek = np.abs(np.arctan2(middle[:, 1], middle[:, 0]) + np.pi / 6) < np.pi / 3  # from -90 to 30 degrees
    half = [Mesh(fruit.triangles[side], fruit.normals[side]) for side in (~cheek, cheek)]
    cleft = np.array([(0, -r - 0.0005, z) for r, z in profile[2:-1]] + [(0, 0, 0.069)])
    return {
        "peach": half[0],
        "blush": join(half[1], tube(cleft, 0.0018, 4)),
        "brown": tube([(0, 0, 0.066), (0.001, 0, 0.080)], 0.003, 5),
        "green": leaf(0.042, 0.018).turned("y", -0.2).turned("z", 2.6).moved(0, 0, 0.075),
    }


def cereal_box() -> Paint:
    """Cereal box, 20 x 6 x 29 cm, with a bowl of flakes on both sides."""
    depth, middle, radius = 0.03, 0.115, 0.062
    bowl = radius * np.concatenate([[(1.0, 0.05), (-1.0, 0.05)], arc(1.0, 1.06 * np.pi, 1.94 * np.pi, 6)])
    milk = radius * arc(1.0, 0, np.pi, 6) * [1, 0.3] + [0, 0.003]
    floating = ((-0.036, 0.006), (-0.014, 0.012), (0.010, 0.007), (0.034, 0.011))
    falling = ((-0.025, 0.040), (0.005, 0.055), (0.030, 0.036))
    flakes = join(*(disc(0.010, 5).moved(x, y, GAP) for x, y in floating + falling))
    bands = join(panel(0.20, 0.05).moved(y=0.235), panel(0.20, 0.02).moved(y=0.02))
    return {
        "red": box(0.20, 0.06, 0.29),
        "yellow": both(bands, depth, 0),
        "navy": both(lettering("FLAKES", 0.038, 0.165).moved(z=GAP), depth, 0.235),
        "white": both(patch(milk), depth, middle),
        "blue": both(patch(bowl), depth, middle),
        "orange": both(flakes, depth, middle),
    }


def juice_box() -> Paint:
    """Small juice carton with an orange on it and a bent straw."""
    y = 0.022
    return {
        "lime": box(0.062, 0.044, 0.105),
        "white": join(
            tube([(0.018, 0, 0.104), (0.018, 0, 0.132), (0.002, 0, 0.146)], 0.0035, 6),
            both(panel(0.062, 0.030), y, 0.088),
        ),
        "orange": both(disc(0.022, 10), y, 0.040),
        "lemon": both(disc(0.016, 8).moved(z=GAP), y, 0.040),
        "green": both(lettering("JUICE", 0.018, 0.055).moved(z=GAP), y, 0.088),
    }


def milk_carton() -> Paint:
    """Gable-top milk carton, 24 cm high."""
    square, ridge = rectangle(0.09, 0.09), rectangle(0.09, 0.006)
    body = loft([at_height(square, 0), at_height(square, 0.170), at_height(ridge, 0.215), at_height(ridge, 0.238)])
    band = both(join(panel(0.09, 0.045), panel(0.09, 0.008).moved(y=-0.040)), 0.045, 0.06)
    drop = patch([(0.012, 0.0), (0, 0.024), (-0.012, 0), (-0.009, -0.009), (0, -0.013), (0.009, -0.009)])
    return {
        "white": join(body, both(drop.moved(z=GAP), 0.045, 0.058)),
        "blue": join(band, band.turned("z", np.pi / 2), both(lettering("MILK", 0.036, 0.082), 0.045, 0.128)),
        "red": cylinder(0.015, 0.014, 8).turned("x", 0.75).moved(0, -0.024, 0.192),
    }


def chocolate_syrup() -> Paint:
    """Brown squeeze bottle with a pointed cap."""
    return {
        "chocolate": join(
            lathe([(0, 0), (0.032, 0), (0.034, 0.006), (0.034, 0.024)], 12),
            lathe([(0.034, 0.110), (0.034, 0.120), (0.020, 0.145)], 12),
        ),
        "yellow": lathe([(0.034, 0.024), (0.034, 0.110)], 12),
        "brown": front(climbing(lettering("CHOCO", 0.028, 0.080)), 0.034, 0.067),
        "red": lathe([(0.021, 0.145), (0.021, 0.158), (0.010, 0.164), (0.004, 0.195), (0, 0.195)], 9),
    }


def whipped_cream() -> Paint:
    """Spray can of whipped cream with a white nozzle, 21 cm high."""
    return {
        "red": lathe([(0, 0), (0.030, 0), (0.030, 0.030)], 12),
        "blue": lathe([(0.030, 0.030), (0.030, 0.150)], 12),
        "silver": lathe([(0.030, 0.150), (0.027, 0.162), (0.011, 0.170)], 12),
        "white": join(
            lathe([(0.012, 0.168), (0.010, 0.182), (0.005, 0.212), (0, 0.212)], 7),
            front(climbing(lettering("CREAM", 0.026, 0.095)), 0.030, 0.094),
        ),
    }


def water_bottle() -> Paint:
    """Water bottle, 24 cm high, with a waist, a blue label and a cap."""
    base = [(0, 0), (0.030, 0), (0.033, 0.010), (0.033, 0.060), (0.030, 0.066), (0.033, 0.072), (0.033, 0.080)]
    return {
        "ice": join(lathe(base, 10), lathe([(0.033, 0.162), (0.014, 0.208), (0.014, 0.216)], 10)),
        "sky": lathe([(0.033, 0.080), (0.033, 0.162)], 10),
        "white": front(climbing(lettering("WATER", 0.026, 0.074)), 0.033, 0.121),
        "blue": cylinder(0.016, 0.022, 10).moved(z=0.216),
    }


def wine_bottle() -> Paint:
    """Green wine bottle, 30 cm high, with a cream label and a red capsule."""
    neck = [(0.038, 0.160), (0.038, 0.185), (0.030, 0.208), (0.015, 0.225), (0.014, 0.240)]
    capsule = [(0.0145, 0.238), (0.0150, 0.285), (0.0165, 0.286), (0.0165, 0.300), (0, 0.300)]
    places = ((-0.010, 0), (0, 0), (0.010, 0), (-0.005, -0.008), (0.005, -0.008), (0, -0.016))
    grapes = join(*(disc(0.005, 6).moved(x, y) for x, y in places))
    return {
        "bottle": join(lathe([(0, 0), (0.037, 0), (0.038, 0.004), (0.038, 0.060)], 12), lathe(neck, 12)),
        "wine": join(lathe(capsule, 9), bent(lettering("WINE", 0.022, 0.054), 0.038, 0.138)),
        "cream": lathe([(0.038, 0.060), (0.038, 0.160)], 12),
        "violet": bent(grapes, 0.038, 0.100),
    }
