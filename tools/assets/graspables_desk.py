"""Paper, games and electronics. Each function returns the painted meshes of the class that it is named after."""

import numpy as np

from tools.assets.decals import GAP, lettering, line, panel, patch
from tools.assets.meshes import (
    Mesh,
    arc,
    at_height,
    box,
    cylinder,
    extrude,
    join,
    loft,
    ngon,
    rounded_box,
    tube,
)
from tools.assets.model import Paint


def board_game() -> Paint:
    """Board game, 32 x 32 x 5 cm: a chequered board on the lid, with pieces."""
    top, side = 0.05, 0.042
    cells = side * (np.arange(6) - 2.5)
    squares = [panel(side, side).moved(x, y) for i, x in enumerate(cells) for j, y in enumerate(cells) if (i + j) % 2]
    cone = loft([at_height(ngon(0.014, 6), 0), at_height(ngon(0.004, 6), 0.022)], caps=False)
    head = loft([at_height(ngon(r, 6), z) for r, z in ((0, 0.018), (0.009, 0.026), (0, 0.034))], caps=False)
    pawns = [join(cone, head).moved(cells[i], cells[j], top) for i, j in ((0, 1), (2, 3), (4, 2), (5, 5))]
    return {
        "green": box(0.32, 0.32, 0.032).moved(z=top - 0.032),
        "crimson": box(0.312, 0.312, 0.020),
        "cream": panel(6.5 * side, 6.5 * side).moved(z=top + GAP),
        "brown": join(*squares).moved(z=top + 2 * GAP),
        "red": join(*pawns[::2]),
        "blue": join(*pawns[1::2]),
    }


def book() -> Paint:
    """Closed book, 22 x 15 x 4 cm, lying flat, its pages towards -y."""
    cover = box(0.22, 0.15, 0.005)
    spine = box(0.22, 0.006, 0.042).moved(y=0.072)
    frame = [panel(0.19, 0.003).moved(y=y) for y in (-0.060, 0.050)]
    frame += [panel(0.003, 0.113).moved(x, -0.005) for x in (-0.0935, 0.0935)]
    return {
        "navy": join(cover, cover.moved(z=0.037), spine),
        "paper": box(0.212, 0.144, 0.032).moved(z=0.005),
        "gold": join(*frame, lettering("NOVEL", 0.038, 0.13).moved(y=-0.004)).moved(z=0.042 + GAP),
        "red": box(0.012, 0.016, 0.002).moved(0.05, -0.078, 0.020),
    }


def folder() -> Paint:
    """Manila folder, 32 x 24 cm, lying flat: tab and papers towards -y."""
    tab = [(-0.13, -0.120), (-0.03, -0.120), (-0.015, -0.098), (0.16, -0.098)]
    back = [(-0.16, -0.098), (-0.145, -0.098), *tab, (0.16, 0.115), (-0.16, 0.115)]
    cover = [(-0.16, -0.085), (0.16, -0.085), (0.16, 0.115), (-0.16, 0.115)]
    rules = [panel(width, 0.005).moved(0.05, y) for width, y in ((0.09, 0.025), (0.09, 0.008), (0.06, -0.009))]
    return {
        "manila": join(extrude(back, 0.006), extrude(cover, 0.006).moved(z=0.016)),
        "paper": join(box(0.30, 0.200, 0.005).moved(0, 0.008, 0.006), box(0.29, 0.2, 0.004).moved(0.008, 0.013, 0.012)),
        "white": panel(0.13, 0.070).moved(0.05, 0.008, 0.022 + GAP),
        "red": panel(0.075, 0.012).moved(-0.08, -0.110, 0.006 + GAP),
        "grey": join(*rules).moved(z=0.022 + 2 * GAP),
    }


def magazine() -> Paint:
    """Glossy magazine, 28 x 21 cm, with a portrait on the cover."""
    hair = patch(np.concatenate([arc(0.034, -0.2, np.pi + 0.2, 8), [(-0.038, -0.050), (0.038, -0.050)]]))
    shoulders = patch([(-0.07, -0.105), (0.07, -0.105), (0.05, -0.065), (-0.05, -0.065)])
    places = (
        (0.06, -0.090, 0.0),
        (0.05, -0.095, -0.02),
        (0.055, -0.092, -0.04),
        (0.05, 0.095, -0.05),
        (0.06, 0.09, -0.07),
    )
    headlines = [panel(width, 0.007).moved(x, y) for width, x, y in places]
    top = 0.020 + GAP
    face = join(patch(ngon(1, 10) * [0.023, 0.030]).moved(y=-0.018), panel(0.022, 0.030).moved(y=-0.055))
    return {
        "sky": box(0.28, 0.21, 0.004).moved(z=0.016),
        "paper": join(box(0.276, 0.206, 0.016), join(*headlines).moved(z=top)),
        "rose": join(lettering("STYLE", 0.048, 0.23), shoulders.moved(y=-0.072)).moved(y=0.072, z=top),
        "brown": hair.moved(0, -0.01, top),
        "peach": face.moved(z=top + GAP),
        "red": panel(0.014, 0.005).moved(0, -0.034, top + 2 * GAP),
    }


def mobile_phone() -> Paint:
    """Mobile phone, 16 cm long, screen up, with app icons."""
    top = 0.012 + GAP
    icons: Paint = {}
    for n, colour in enumerate(("green", "orange", "rose", "sky")):
        spots = [(0.045 - 0.024 * row, 0.0225 - 0.015 * ((n + row) % 4)) for row in range(3)]
        icons[colour] = join(*(panel(0.014, 0.011).moved(x, y, top + GAP) for x, y in spots))
    status = join(panel(0.004, 0.025).moved(-0.068), panel(0.014, 0.056).moved(-0.052))
    return {
        "silver": rounded_box(0.16, 0.076, 0.012, 0.010, 2, bevel=0.002),
        "navy": panel(0.148, 0.066).moved(z=top),
        "white": status.moved(z=top + GAP),
        **icons,
    }


def notes() -> Paint:
    """Yellow note pad, 15 x 12 cm, ruled and written on, with a pencil."""
    top = 0.022
    rules = [panel(0.13, 0.002).moved(0, y) for y in (0.024, 0.008, -0.008, -0.024, -0.040)]
    words = ((-0.056, -0.030, 0.030), (-0.018, 0.008, 0.030), (0.020, 0.050, 0.030), (-0.056, -0.018, 0.014))
    pencil = cylinder(0.005, 0.100, 6).turned("y", np.pi / 2)
    tip = cylinder(0.005, 0.016, 6, top=0.001).turned("y", np.pi / 2)
    place = {"x": 0.012, "y": -0.024, "z": top + 0.005}
    return {
        "lemon": box(0.15, 0.12, top),
        "crimson": box(0.152, 0.018, top + 0.003).moved(y=0.052),
        "sky": join(*rules).moved(z=top + GAP),
        "navy": join(*(line((start, y), (end, y), 0.005) for start, end, y in words)).moved(z=top + 2 * GAP),
        "orange": pencil.moved(-0.045).turned("z", 0.35).moved(**place),
        "cream": tip.moved(0.055).turned("z", 0.35).moved(**place),
        "rose": cylinder(0.0052, 0.010, 6).turned("y", np.pi / 2).moved(-0.055).turned("z", 0.35).moved(**place),
    }


def remote_control() -> Paint:
    """Remote control, 19 cm long, buttons up."""
    top = 0.020

    def button(x: float, y: float, width: float) -> Mesh:
        low, high = ngon(0.7 * width, 4), ngon(0.55 * width, 4)
        rings = [at_height(low, 0), at_height(high, 0.003), at_height(0 * high, 0.0031)]
        return loft(rings, caps=False).turned("z", np.pi / 4).moved(x, y, top)

    digits = [button(0.012 - 0.021 * i, 0.017 - 0.017 * j, 0.010) for i in range(3) for j in range(3)]
    return {
        "charcoal": rounded_box(0.19, 0.055, top, 0.010, 1, bevel=0.004),
        "white": join(*digits),
        "red": button(0.081, 0.014, 0.013),
        "steel": tube(at_height(ngon(0.015, 8), top), 0.003, 3, closed=True).moved(0.050),
        "blue": button(0.050, 0, 0.012),
        "green": button(-0.068, 0.014, 0.012),
        "yellow": button(-0.068, -0.014, 0.012),
    }
