"""Flat things: pictures, mirrors, windows and rugs."""

from collections.abc import Sequence

import numpy as np

from tools.assets.furniture_model import Block, Model, ellipse, facing, panel
from tools.assets.meshes import Mesh, cylinder, extrude, ngon, rounded_box


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        picture_landscape(),
        picture_portrait(),
        picture_abstract(),
        mirror_wall(),
        mirror_standing(),
        window_wide(),
        _window("window_tall", 0.9, 1.3, panes=1),
        rug_rect(),
        rug_round(),
        rug_bath(),
    ]


def _framed(name: str, width: float, height: float, frame: str, ground: str) -> Model:
    """Return a framed canvas; z = 0 is the frame's lower edge and paint starts at x = 0.01."""
    model = Model(name, primary=frame, secondary=ground)
    bar = 0.035
    bars: list[Block] = [((0.04, width, bar), (0, 0, z)) for z in (0, height - bar)]
    bars += [((0.04, bar, height - 2 * bar), (0, s * (width - bar) / 2, bar)) for s in (-1, 1)]
    model.blocks("frame", "primary", bars)
    model.block("secondary", (0.02, width - bar, height - bar), (-0.005, 0, bar / 2), solid=False)
    model.solid((0.04, width, height))
    return model


def _disc(radius: float, x: float, y: float, z: float) -> Mesh:
    """Return a painted disc with its back at ``x``."""
    return facing(extrude(ngon(radius, 10), 0.003), x, y, z)


def picture_landscape() -> Model:
    """Return hills under a blue sky with a sun and a house."""
    model = _framed("picture_landscape", 0.8, 0.55, "walnut", "sky")
    far = [(-0.37, 0.035), (0.37, 0.035), (0.37, 0.26), (0.2, 0.36), (0.02, 0.22), (-0.18, 0.33), (-0.37, 0.2)]
    model.shape("hills", "blue", panel(far, 0.002, 0.006))
    near = [(-0.37, 0.035), (0.37, 0.035), (0.37, 0.14), (0.1, 0.2), (-0.15, 0.17), (-0.37, 0.12)]
    model.shape("meadow", "leaf", panel(near, 0.005, 0.006))
    model.shape("sun", "yellow", _disc(0.05, 0.005, 0.22, 0.42))
    model.shape("roof", "red", panel([(-0.2, 0.2), (-0.04, 0.2), (-0.12, 0.27)], 0.008, 0.006))
    model.block("cream", (0.006, 0.12, 0.09), (0.011, -0.12, 0.11), solid=False)
    return model


def picture_portrait() -> Model:
    """Return a person in a red coat."""
    model = _framed("picture_portrait", 0.5, 0.7, "brass", "sage")
    coat = [(-0.2, 0.035), (0.2, 0.035), (0.17, 0.2), (0.07, 0.28), (-0.07, 0.28), (-0.17, 0.2)]
    model.shape("coat", "burgundy", panel(coat, 0.002, 0.006))
    model.shape("hair", "soil", facing(extrude(ellipse(0.26, 0.32), 0.003), 0.004, 0, 0.46))
    model.shape("face", "rose", facing(extrude(ellipse(0.18, 0.24), 0.005), 0.006, 0, 0.42))
    model.block("cream", (0.006, 0.1, 0.06), (0.009, 0, 0.24), solid=False)
    model.blocks("eyes", "black", [((0.003, 0.025, 0.015), (0.0125, y, 0.44)) for y in (-0.04, 0.04)])
    model.block("red", (0.003, 0.05, 0.012), (0.0125, 0, 0.355), solid=False)
    return model


def picture_abstract() -> Model:
    """Return a grid of primary colours."""
    model = _framed("picture_abstract", 0.9, 0.6, "black", "white")
    columns, rows = (-0.415, -0.03, 0.17, 0.415), (0.035, 0.2, 0.36, 0.565)
    fields = (("red", 0, 1), ("red", 0, 2), ("mustard", 0, 0), ("blue", 2, 0), ("yellow", 2, 2), ("teal", 1, 1))
    for colour in dict.fromkeys(colour for colour, _, _ in fields):
        cells = [(c, r) for name, c, r in fields if name == colour]
        model.shape(colour, colour, *(_field(columns[c : c + 2], rows[r : r + 2]) for c, r in cells))
    lines: list[Block] = [((0.006, 0.022, 0.53), (0.0115, y, 0.035)) for y in columns[1:3]]
    lines += [((0.006, 0.83, 0.022), (0.0115, 0, z - 0.011)) for z in rows[1:2]]
    lines += [((0.006, 0.445, 0.022), (0.0115, 0.1925, rows[2] - 0.011))]
    model.blocks("lines", "black", lines)
    return model


def _field(y: Sequence[float], z: Sequence[float]) -> Mesh:
    """Return a painted rectangle between two y and two z."""
    return panel([(y[0], z[0]), (y[1], z[0]), (y[1], z[1]), (y[0], z[1])], 0.004, 0.006)


def mirror_wall() -> Model:
    """Return a framed mirror for a wall."""
    model = _framed("mirror_wall", 0.6, 0.9, "dark_steel", "mirror")
    _shine(model, 0.005, 0.45, 0.7)
    return model


def _shine(model: Model, x: float, low: float, high: float) -> None:
    """Add two slanted streaks of light to a pane whose front is at ``x``."""
    streaks = [
        panel([(y, low), (y + w, low), (y + w + 0.14, high), (y + 0.14, high)], x, 0.003)
        for y, w in ((-0.16, 0.07), (-0.04, 0.03))
    ]
    model.shape("shine", "ceramic", *streaks)


def mirror_standing() -> Model:
    """Return a tall mirror leaning in its stand."""
    model = Model("mirror_standing", primary="oak", secondary="mirror")
    tilt = np.radians(-5)

    def lean(mesh: Mesh) -> Mesh:
        return mesh.turned("y", tilt).moved(0.09, 0, 0.04)

    model.shape("frame", "primary", lean(rounded_box(0.035, 0.55, 1.66, 0.01, bevel=0)))
    pane = panel([(-0.23, 0.05), (0.23, 0.05), (0.23, 1.6), (-0.23, 1.6)], 0.016, 0.004)
    model.shape("pane", "secondary", lean(pane))
    streak = panel([(-0.15, 0.7), (-0.07, 0.7), (0.1, 1.1), (0.02, 1.1)], 0.02, 0.003)
    model.shape("shine", "ceramic", lean(streak))
    model.blocks("feet", "primary", [((0.35, 0.04, 0.05), (0, y, 0)) for y in (-0.22, 0.22)])
    model.solid((0.35, 0.55, 0.05))
    model.solid((0.18, 0.55, 1.65), (0.02, 0, 0.05))
    return model


def _window(name: str, width: float, height: float, panes: int) -> Model:
    """Return a window with a sill; it shows sky over trees, and curtains at its sides."""
    model = Model(name, primary="white", secondary="linen")
    depth, bar = 0.06, 0.05
    model.block("sky", (0.02, width - bar, height - bar), (-0.01, 0, bar / 2), solid=False)
    side = width / 2 - bar
    trees = [(-side, bar), (side, bar), (side, 0.3 * height), (0.2 * width, 0.36 * height), (0.0, 0.27 * height)]
    trees += [(-0.25 * width, 0.33 * height), (-side, 0.24 * height)]
    model.shape("trees", "leaf", panel(trees, -0.002, 0.005))
    bars: list[Block] = [((depth, width, bar), (0, 0, z)) for z in (0, height - bar)]
    bars += [((depth, bar, height), (0, s * (width - bar) / 2, 0)) for s in (-1, 1)]
    cross: list[Block] = [((0.03, 0.035, height), (0.0, width * (i / panes - 0.5), 0)) for i in range(1, panes)]
    cross.append(((0.03, width, 0.03), (0.0, 0, 0.62 * height)))
    model.blocks("frame", "primary", bars + cross)
    pleats = ((0.455, 0.026), (0.405, 0.018), (0.355, 0.026))
    pleat = 0.05 * width
    curtains: list[Block] = [
        ((x, pleat, height - 0.06), (x / 2, s * y * width, 0.03)) for s in (-1, 1) for y, x in pleats
    ]
    model.blocks("curtains", "secondary", curtains)
    model.solid((depth, width, height))
    return model


def window_wide() -> Model:
    """Return a wide window of two panes."""
    return _window("window_wide", 1.4, 1.1, panes=2)


def rug_rect() -> Model:
    """Return a rug with a border and a field of diamonds."""
    model = Model("rug_rect", primary="burgundy", secondary="cream")
    model.block("secondary", (1.6, 2.3, 0.006), solid=False)
    model.block("primary", (1.44, 2.14, 0.004), (0, 0, 0.005), solid=False)
    diamonds = [extrude(ngon(0.26, 4), 0.003).moved(0, y, 0.008) for y in (-0.66, 0, 0.66)]
    model.shape("diamonds", "mustard", *diamonds)
    return model


#: Part, colour, radius and layer of the round rug's discs.
RINGS = (("edge", "primary", 0.8, 0), ("ring", "secondary", 0.66, 1), ("field", "primary", 0.5, 2))


def rug_round() -> Model:
    """Return a round rug with rings."""
    model = Model("rug_round", primary="teal", secondary="cream")
    for part, colour, radius, z in RINGS:
        model.shape(part, colour, cylinder(radius, 0.006, 24).moved(z=0.003 * z))
    model.shape("centre", "secondary", cylinder(0.2, 0.006, 12).moved(z=0.009))
    return model


def rug_bath() -> Model:
    """Return a small striped bath mat."""
    model = Model("rug_bath", primary="blue", secondary="white")
    model.block("primary", (0.5, 0.8, 0.012), solid=False)
    model.blocks("stripes", "secondary", [((0.5, 0.06, 0.003), (0, y, 0.011)) for y in (-0.3, 0.3)])
    return model
