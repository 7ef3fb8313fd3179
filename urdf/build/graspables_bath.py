"""Bathroom things. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from urdf.build.decals import bent, both, climbing, lettering, twice
from urdf.build.meshes import (
    Mesh,
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

Paint = dict[str, Mesh]


def face_cream() -> Paint:
    """Jar of face cream, 8 cm wide, with a gold lid."""
    word = bent(lettering("CREAM", 0.018, 0.058), 0.040, 0.022)
    return {
        "pink": lathe([(0, 0), (0.036, 0), (0.040, 0.005), (0.040, 0.040), (0.036, 0.044)], 14),
        "gold": lathe([(0.038, 0.044), (0.041, 0.047), (0.041, 0.062), (0.037, 0.066), (0, 0.066)], 14),
        "wine": twice(word),
    }


def lotion() -> Paint:
    """Pump bottle of body lotion, 20 cm high."""
    word = both(climbing(lettering("LOTION", 0.026, 0.096)), 0.0330, 0.072)
    pump = join(
        cylinder(0.015, 0.018, 6).moved(z=0.145),
        cylinder(0.005, 0.026, 4).moved(z=0.160),
        rounded_box(0.026, 0.022, 0.012, 0.005, bevel=0.003).moved(z=0.184),
        tube([(-0.008, 0, 0.191), (-0.042, 0, 0.191), (-0.048, 0, 0.183)], 0.0045, 5),
    )
    return {
        "cream": lathe([(0, 0), (0.031, 0), (0.033, 0.005), (0.033, 0.125), (0.014, 0.147)], 12),
        "brown": pump,
        "green": join(word, lathe([(0.0336, 0.008), (0.0336, 0.018)], 12)),
    }


def shampoo() -> Paint:
    """Flat shampoo bottle, 21 cm high, with a flip cap and bubbles."""
    oval = ngon(1.0, 12) * [0.040, 0.024]
    rings = [at_height(s * oval, z) for s, z in ((0.88, 0), (1, 0.008), (1, 0.135), (0.55, 0.170))]
    return {
        "violet": loft(rings),
        "white": join(
            loft([at_height(0.60 * oval, 0.166), at_height(0.60 * oval, 0.205)]),
            both(climbing(lettering("SHAMPOO", 0.026, 0.100)), 0.0245, 0.072),
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
    rings = [
        np.column_stack([np.full(12, x), width * circle[:, 0], 0.020 + height * circle[:, 1]])
        for x, width, height in (
            (-0.090, 0.030, 0.003),
            (-0.078, 0.030, 0.004),
            (0.045, 0.020, 0.019),
            (0.052, 0.010, 0.010),
        )
    ]
    stripe = join(*(box(0.110, 0.006, 0.003).turned("y", -0.12).moved(-0.018, y, 0.030) for y in (-0.011, 0.011)))
    word = lettering("MINT", 0.018, 0.05).turned("y", -0.12).moved(-0.018, 0, 0.034)
    return {
        "white": loft(rings),
        "red": cylinder(0.0145, 0.035, 10, top=0.012).turned("y", np.pi / 2).moved(0.052, 0, 0.020),
        "teal": word,
        "mint": stripe,
    }


def hairbrush() -> Paint:
    """Paddle hairbrush, 23 cm long, bristles up."""
    head = extrude(ngon(1.0, 12) * [0.058, 0.036], 0.014).moved(0.055)
    pad = extrude(ngon(1.0, 12) * [0.048, 0.028], 0.005, top=0.9).moved(0.055, 0, 0.014)
    places = [(x, y) for x in (0.025, 0.045, 0.065, 0.085) for y in (-0.014, 0, 0.014)]
    spikes = [
        loft([at_height(ngon(0.0045, 4), 0), at_height(ngon(0.0015, 4), 0.018)]).moved(x, y, 0.018) for x, y in places
    ]
    return {
        "brown": join(head, rounded_box(0.120, 0.024, 0.018, 0.007).moved(-0.055)),
        "rose": pad,
        "black": join(*spikes),
    }


def towel() -> Paint:
    """Folded hand towel, 30 x 20 cm, with stripes."""
    layers = [
        rounded_box(0.30 - 0.006 * n, 0.20 - 0.004 * n, 0.026, 0.012, bevel=0.010).moved(z=0.024 * n) for n in range(3)
    ]
    stripes = [box(0.016, 0.188, 0.002).moved(x, 0, 0.073) for x in (-0.110, -0.085, 0.085, 0.110)]
    fold = [
        box(0.016, 0.002, 0.014).moved(x, -0.1005 + 0.002 * n, 0.006 + 0.024 * n)
        for n in range(3)
        for x in (-0.097, 0.097)
    ]
    return {"sky": join(*layers), "white": join(*stripes), "blue": join(*fold)}


def slippers() -> Paint:
    """Pair of house slippers, 26 cm long."""
    sole = np.array(
        [
            (-0.13, -0.022),
            (-0.12, -0.036),
            (-0.02, -0.034),
            (0.06, -0.046),
            (0.11, -0.036),
            (0.13, 0),
            (0.11, 0.036),
            (0.06, 0.046),
            (-0.02, 0.034),
            (-0.12, 0.036),
            (-0.13, 0.022),
        ]
    )
    angles = np.linspace(0, np.pi, 6)
    rings = []
    for x, width, height in ((0.0, 0.037, 0.058), (0.06, 0.043, 0.052), (0.105, 0.034, 0.038), (0.124, 0.010, 0.024)):
        rings.append(
            np.column_stack([np.full(6, x), width * np.cos(angles), 0.012 + (height - 0.012) * np.sin(angles)])
        )
    one = {"rose": loft(rings), "cream": extrude(0.92 * sole, 0.006).moved(z=0.016), "wine": extrude(sole, 0.018)}
    opening = loft([ring * [1, 0.9, 0.9] + [-0.001, 0, 0.002] for ring in rings[:2]])
    one["chocolate"] = opening
    return {name: join(mesh.moved(y=-0.055), mesh.moved(y=0.055)) for name, mesh in one.items()}
