"""Bathroom things. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from tools.assets.decals import GAP, bent, both, climbing, front, lettering, panel, patch, twice, upright
from tools.assets.meshes import (
    arc,
    at_height,
    box,
    cylinder,
    extrude,
    join,
    lathe,
    loft,
    ngon,
    rounded_box,
    tube,
)
from tools.assets.model import Paint


def face_cream() -> Paint:
    """Jar of face cream, 8 cm wide, with a gold lid."""
    return {
        "pink": lathe([(0, 0), (0.036, 0), (0.040, 0.005), (0.040, 0.044)], 14),
        "gold": lathe([(0.037, 0.044), (0.042, 0.045), (0.042, 0.062), (0.038, 0.066), (0, 0.066)], 14),
        "wine": twice(bent(lettering("CREAM", 0.018, 0.052), 0.040, 0.023)),
    }


def lotion() -> Paint:
    """Pump bottle of body lotion, 20 cm high."""
    word = front(climbing(lettering("LOTION", 0.026, 0.096)), 0.033, 0.072)
    pump = join(
        cylinder(0.015, 0.018, 6).moved(z=0.145),
        cylinder(0.005, 0.026, 4).moved(z=0.160),
        rounded_box(0.026, 0.022, 0.012, 0.006, bevel=0).moved(z=0.184),
        tube([(-0.008, 0, 0.191), (-0.042, 0, 0.191), (-0.048, 0, 0.183)], 0.0045, 5),
    )
    return {
        "cream": lathe([(0.033, 0.016), (0.033, 0.125), (0.014, 0.147)], 12),
        "brown": pump,
        "green": join(word, lathe([(0, 0), (0.031, 0), (0.033, 0.005), (0.033, 0.016)], 12)),
    }


def shampoo() -> Paint:
    """Oval shampoo bottle, 21 cm high, with a white cap."""
    oval = ngon(1.0, 12) * [0.040, 0.024]
    rings = [at_height(s * oval, z) for s, z in ((0.88, 0), (1, 0.008), (1, 0.135), (0.55, 0.170))]
    return {
        "violet": loft(rings),
        "white": join(
            loft([at_height(0.60 * oval, 0.166), at_height(0.60 * oval, 0.205)]),
            front(climbing(lettering("SHAMPOO", 0.026, 0.100)), 0.024, 0.072),
        ),
    }


def toothbrush() -> Paint:
    """Chunky toothbrush, 21 cm long, bristles up."""
    half = [(-0.105, 0.011), (-0.020, 0.016), (0.035, 0.009), (0.055, 0.016), (0.105, 0.016)]
    outline = [*((x, -y) for x, y in half), *reversed(half)]
    tuft = box(0.009, 0.027, 0.018)
    tufts = [tuft.moved(x, 0, 0.011) for x in (0.060, 0.0725, 0.085, 0.0975)]
    grip = rounded_box(0.065, 0.018, 0.003, 0.005, bevel=0).moved(-0.045, 0, 0.012)
    return {"blue": extrude(outline, 0.012), "white": join(grip, *tufts[1::2]), "mint": join(*tufts[::2])}


def toothpaste() -> Paint:
    """Tube of toothpaste, 18 cm long, lying flat, with a red cap."""
    circle = ngon(1.0, 12)
    sections = ((-0.090, 0.030, 0.003), (-0.078, 0.030, 0.004), (0.045, 0.020, 0.019), (0.052, 0.010, 0.010))
    rings = [np.column_stack([np.full(12, x), [0, 0.020] + circle * [width, height]]) for x, width, height in sections]
    stripes = [box(0.110, 0.006, 0.003).moved(y=y) for y in (-0.011, 0.011)]
    word = lettering("MINT", 0.018, 0.05).moved(z=0.004)
    return {
        "white": loft(rings),
        "red": cylinder(0.0145, 0.035, 10, top=0.012).turned("y", np.pi / 2).moved(0.052, 0, 0.020),
        "teal": word.turned("y", -0.12).moved(-0.018, 0, 0.030),
        "mint": join(*stripes).turned("y", -0.12).moved(-0.018, 0, 0.030),
    }


def hairbrush() -> Paint:
    """Paddle hairbrush, 23 cm long, bristles up."""
    oval = ngon(1.0, 12)
    head = extrude(oval * [0.058, 0.036], 0.014).moved(0.055)
    bristle = loft([at_height(ngon(0.005, 4), 0), at_height(ngon(0.0, 4), 0.020)], caps=False)
    bristles = [bristle.moved(x, y, 0.018) for x in (0.022, 0.039, 0.056, 0.073, 0.090) for y in (-0.015, 0, 0.015)]
    return {
        "brown": join(head, rounded_box(0.120, 0.024, 0.018, 0.007).moved(-0.055)),
        "rose": extrude(oval * [0.048, 0.028], 0.005, top=0.9).moved(0.055, 0, 0.014),
        "black": join(*bristles),
    }


def towel() -> Paint:
    """Folded hand towel, 30 x 20 cm: three layers, white stripes."""
    layer = rounded_box(0.30, 0.20, 0.027, 0.014, bevel=0.010)
    places = (-0.115, -0.090, 0.090, 0.115)
    edges = join(*(panel(0.014, 0.008).moved(x) for x in places))
    return {
        "sky": join(*(layer.moved(z=0.025 * n) for n in range(3))),
        "white": join(*(panel(0.014, 0.188).moved(x, 0, 0.077 + GAP) for x in places)),
        "blue": join(*(both(edges, 0.10, 0.0135 + 0.025 * n) for n in range(3))),
    }


def slippers() -> Paint:
    """Pair of house slippers, 26 cm long, toes towards +x."""
    side = [(-0.13, 0.022), (-0.12, 0.036), (-0.02, 0.034), (0.06, 0.046), (0.11, 0.036), (0.13, 0.010)]
    sole = np.array([*((x, -y) for x, y in side), *reversed(side)])
    half = arc(1.0, 0, np.pi, 5)
    sections = ((0.0, 0.037, 0.046), (0.06, 0.043, 0.040), (0.105, 0.034, 0.026), (0.124, 0.010, 0.012))
    rings = [np.column_stack([np.full(6, x), [0, 0.012] + half * [width, height]]) for x, width, height in sections]
    opening = upright(patch(half * [0.033, 0.041])).turned("z", -np.pi / 2)
    one = {
        "wine": extrude(sole, 0.018),
        "cream": extrude(0.92 * sole, 0.006).moved(z=0.016),
        "rose": loft(rings),
        "chocolate": opening.moved(-GAP, 0, 0.014),
    }
    return {colour: join(mesh.moved(y=-0.055), mesh.moved(y=0.055)) for colour, mesh in one.items()}
