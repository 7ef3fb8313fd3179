"""Soft furniture: beds, sofas and the armchair."""

import numpy as np

from tools.assets.furniture_model import Model, soft_box
from tools.assets.meshes import Mesh, rounded_box

#: Depth of a sofa's back with its cushions.
CUSHIONED = 0.275


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        _bed("bed_double", 1.6, 2, "navy", "oak"),
        _bed("bed_single", 0.95, 1, "terracotta", "white"),
        _sofa("sofa_two", 0.9, 1.6, 2, "sage", "mustard"),
        _sofa("sofa_three", 0.95, 2.1, 3, "grey", "teal"),
        sofa_chaise(),
        chair_armchair(),
    ]


def _bed(name: str, width: float, pillows: int, duvet: str, wood: str) -> Model:
    """Return a bed with its head at -x: frame, mattress, folded duvet and pillows; the top lies at 0.5 m."""
    model = Model(name, primary=duvet, secondary=wood)
    model.block("secondary", (0.06, width, 1.0), (-0.995, 0, 0))
    model.block("secondary", (1.99, width, 0.2), (0.03, 0, 0.08), solid=False)
    model.blocks("feet", "secondary", [((0.06, 0.06, 0.08), (0.97, s * (width / 2 - 0.05), 0)) for s in (-1, 1)])
    mattress = rounded_box(1.96, width - 0.04, 0.218, 0.05, bevel=0.02)
    model.shape("mattress", "white", mattress.moved(0.03, 0, 0.28))
    duvet_width = width - 0.004
    model.shape("duvet", "primary", rounded_box(1.34, duvet_width, 0.242, 0.04, bevel=0.02).moved(0.35, 0, 0.26))
    model.shape("fold", "linen", rounded_box(0.2, duvet_width + 0.004, 0.245, 0.04, bevel=0.02).moved(-0.35, 0, 0.259))
    model.solid((1.99, width, 0.28), (0.03, 0, 0))
    model.solid((1.96, width, 0.22), (0.03, 0, 0.28))
    spots = [0.0] if pillows == 1 else [-0.37, 0.37]
    model.shape("pillows", "ceramic", *(_pillow(0.4, 0.6, 0.13).moved(-0.72, y, 0.47) for y in spots))
    for y in spots:
        model.solid((0.2, 0.6, 0.09), (-0.82, y, 0.5))  # two heights: no level top wide enough to use
        model.solid((0.2, 0.6, 0.1), (-0.62, y, 0.5))
    return model


def _pillow(x: float, y: float, z: float) -> Mesh:
    """Return a plump lying pillow."""
    return rounded_box(x, y, z, 0.06, steps=1, bevel=z / 2.2)


def _arm(x: float, y: float, z: float) -> Mesh:
    """Return an armrest with soft edges all round."""
    return rounded_box(x, y, z, 0.035, bevel=0.03)


def _sofa(name: str, depth: float, width: float, seats: int, fabric: str, accent: str) -> Model:
    """Return a sofa with a seat at 0.43 m, arms and one back cushion a seat."""
    model = Model(name, primary=fabric, secondary=accent)
    arm, back = 0.17, 0.24
    inner, seat_depth = width - 2 * arm, depth - back
    _sofa_frame(model, depth, width, arm)
    share = inner / seats
    middles = [(i + 0.5) * share - inner / 2 for i in range(seats)]
    seat = soft_box(seat_depth, share - 0.01, 0.17, bevel=0.02)
    model.shape("seats", "primary", *(seat.moved(back / 2, y, 0.26) for y in middles))
    rest = soft_box(0.17, share - 0.02, 0.42).turned("y", np.radians(-8))
    model.shape("rests", "primary", *(rest.moved(back - depth / 2 - 0.05, y, 0.42) for y in middles))
    model.solid((depth - CUSHIONED, inner, 0.43), (CUSHIONED / 2, 0, 0))
    _throw_cushion(model, back - depth / 2 + 0.08, middles[0] - 0.03)
    return model


def _sofa_frame(model: Model, depth: float, width: float, arm: float) -> None:
    """Add base, back and arms."""
    model.block("primary", (depth - 0.02, width - 0.04, 0.2), (-0.01, 0, 0.07), solid=False)
    model.shape("back", "primary", soft_box(0.14, width, 0.68).moved(0.07 - depth / 2, 0, 0.1))
    arms = (_arm(depth - 0.03, arm, 0.5).moved(0.015, s * (width - arm) / 2, 0.1) for s in (-1, 1))
    model.shape("arms", "primary", *arms)
    feet = [((depth - 0.1, 0.05, 0.1), (0, y, 0)) for y in (0.08 - width / 2, width / 2 - 0.08)]
    model.blocks("feet", "walnut", feet)
    _solid_back(model, -depth / 2, width - 2 * arm, 0)
    for side in (-1, 1):
        model.solid((depth, arm, 0.6), (0, side * (width - arm) / 2, 0))


def _solid_back(model: Model, rear: float, width: float, y: float) -> None:
    """Add the solids of a sofa's back and its cushions, at heights of their own: neither is wide enough to use."""
    model.solid((0.14, width, 0.78), (rear + 0.07, y, 0))
    model.solid((CUSHIONED - 0.14, width, 0.83), (rear + 0.07 + CUSHIONED / 2, y, 0))


def _throw_cushion(model: Model, x: float, y: float) -> None:
    """Add a small cushion that leans back on the seat."""
    cushion = rounded_box(0.36, 0.36, 0.11, 0.05, bevel=0.05).turned("y", np.radians(-75)).moved(0, 0, 0.17)
    model.shape("accent", "secondary", cushion.moved(x + 0.03, y, 0.43))
    model.solid((0.16, 0.34, 0.34), (x + 0.01, y, 0.43))


def sofa_chaise() -> Model:
    """Return an L-shaped sofa; the chaise, on the left of who sits, is 1.5 m deep."""
    model = Model("sofa_chaise", primary="linen", secondary="terracotta")
    depth, width, arm = 1.5, 2.2, 0.17
    rear = -depth / 2
    model.shape("back", "primary", soft_box(0.14, width, 0.68).moved(rear + 0.07, 0, 0.1))
    model.block("primary", (0.9, width - 0.04, 0.2), (rear + 0.47, 0, 0.07), solid=False)
    model.block("primary", (1.46, 0.82, 0.2), (0, width / 2 - 0.43, 0.07), solid=False)
    model.shape("arm", "primary", _arm(0.93, arm, 0.5).moved(rear + 0.485, (arm - width) / 2, 0.1))
    seat_y = [-0.6375 + i * 0.585 for i in range(2)]
    seats = [soft_box(0.73, 0.575, 0.17, bevel=0.02).moved(rear + 0.585, y, 0.26) for y in seat_y]
    model.shape("seats", "primary", *seats, soft_box(1.28, 0.85, 0.17, bevel=0.02).moved(0.11, width / 2 - 0.43, 0.26))
    rests = [(0.565, y) for y in seat_y] + [(0.8, width / 2 - 0.44)]
    turned = [soft_box(0.17, w, 0.42).turned("y", np.radians(-8)).moved(rear + 0.19, y, 0.42) for w, y in rests]
    model.shape("rests", "primary", *turned)
    _throw_cushion(model, rear + 0.32, 0.75)
    feet = [(-0.67, -1.02), (0.12, -1.02), (0.67, 0.3), (0.67, 1.02), (-0.67, 1.02)]
    model.blocks("feet", "walnut", [((0.05, 0.05, 0.1), (x, y, 0)) for x, y in feet])
    _solid_back(model, rear, width - arm, arm / 2)
    model.solid((0.95, arm, 0.6), (rear + 0.475, (arm - width) / 2, 0))
    model.solid((0.675, 1.17, 0.43), (rear + 0.6125, -0.345, 0))
    model.solid((1.225, 0.86, 0.43), (0.1375, width / 2 - 0.43, 0))
    return model


def chair_armchair() -> Model:
    """Return an upholstered easy chair with its seat at 0.42 m."""
    model = Model("chair_armchair", primary="mustard", secondary="walnut")
    model.shape("base", "primary", soft_box(0.74, 0.56, 0.2).moved(0.01, 0, 0.12))
    model.shape("seat", "primary", soft_box(0.56, 0.52, 0.14, bevel=0.02).moved(0.12, 0, 0.28))
    back = soft_box(0.16, 0.52, 0.62).turned("y", np.radians(-8)).moved(-0.24, 0, 0.28)
    model.shape("back", "primary", back)
    model.shape("arms", "primary", *(_arm(0.74, 0.14, 0.46).moved(0.02, y, 0.12) for y in (-0.33, 0.33)))
    model.blocks("feet", "secondary", [((0.05, 0.05, 0.13), (x, y, 0)) for x in (-0.3, 0.33) for y in (-0.33, 0.33)])
    model.solid((0.24, 0.8, 0.88), (-0.28, 0, 0))
    model.solid((0.56, 0.52, 0.42), (0.12, 0, 0))
    for side in (-1, 1):
        model.solid((0.56, 0.14, 0.58), (0.12, 0.33 * side, 0))
    return model
