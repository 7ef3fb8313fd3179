"""Tables: coffee tables, kitchen tables, desks, the round nightstand and the stool."""

import numpy as np

from tools.assets.furniture_model import Model, corners_of, leg
from tools.assets.furniture_storage import fronts
from tools.assets.meshes import cylinder


def models() -> list[Model]:
    """Return the models of this group."""
    return [
        coffee_table_rect(),
        _round_table("coffee_table_round", 0.8, 0.42, "walnut", shelf=0.15),
        kitchen_table_rect(),
        _pedestal_table("kitchen_table_round", 1.1, 0.75),
        kitchen_table_square(),
        desk_plain(),
        desk_drawers(),
        _round_table("nightstand_round", 0.42, 0.55, "birch", shelf=0.2),
        stool_wood(),
    ]


def coffee_table_rect() -> Model:
    """Return a low table with a board under the top."""
    model = Model("coffee_table_rect", primary="oak", secondary="charcoal")
    model.block("primary", (0.6, 1.1, 0.04), (0, 0, 0.38))
    model.block("primary", (0.5, 1.0, 0.02), (0, 0, 0.12))
    _legs(model, (0.6, 1.1, 0.38), width=0.05, inset=0.02)
    return model


def kitchen_table_rect() -> Model:
    """Return a dining table for six."""
    model = Model("kitchen_table_rect", primary="oak", secondary="oak")
    model.block("primary", (0.85, 1.5, 0.035), (0, 0, 0.715))
    model.block("secondary", (0.7, 1.34, 0.08), (0, 0, 0.635))
    _legs(model, (0.85, 1.5, 0.715), width=0.07, inset=0.03)
    return model


def kitchen_table_square() -> Model:
    """Return a small table with a white frame."""
    model = Model("kitchen_table_square", primary="pine", secondary="white")
    model.block("primary", (0.85, 0.85, 0.03), (0, 0, 0.72))
    model.block("secondary", (0.74, 0.74, 0.08), (0, 0, 0.64))
    _legs(model, (0.85, 0.85, 0.72), width=0.06, inset=0.03)
    return model


def desk_plain() -> Model:
    """Return a desk on a metal frame with a low back panel."""
    model = Model("desk_plain", primary="birch", secondary="charcoal")
    model.block("primary", (0.65, 1.3, 0.03), (0, 0, 0.71))
    model.block("secondary", (0.02, 1.14, 0.25), (-0.24, 0, 0.46))
    _legs(model, (0.65, 1.3, 0.71), width=0.05, inset=0.02)
    model.blocks("feet", "secondary", [((0.56, 0.05, 0.03), (0, y, 0)) for y in (-0.605, 0.605)])
    return model


def desk_drawers() -> Model:
    """Return a desk with a drawer pedestal on its right and free knee space beside it."""
    model = Model("desk_drawers", primary="walnut", secondary="walnut")
    model.block("primary", (0.7, 1.5, 0.035), (0, 0, 0.715))
    model.block("secondary", (0.62, 0.45, 0.715), (-0.02, 0.5, 0))
    model.block("secondary", (0.62, 0.04, 0.715), (-0.02, -0.71, 0))
    model.block("secondary", (0.02, 1.0, 0.4), (-0.3, -0.2, 0.315))
    fronts(model, 0.29, (0.275, 0.725), (0.04, 0.7), columns=1, rows=3, handles="drawer", metal="brass")
    return model


def stool_wood() -> Model:
    """Return a round wooden stool on splayed legs."""
    model = Model("stool_wood", primary="pine", secondary="pine")
    model.shape("seat", "primary", cylinder(0.18, 0.035, 12).moved(z=0.415))
    model.solid_round(0.18, 0.035, (0, 0, 0.415))
    angles = np.pi / 4 + np.arange(4) * np.pi / 2
    spots = [(np.cos(a), np.sin(a)) for a in angles]
    legs = [leg((0.15 * x, 0.15 * y), (0.1 * x, 0.1 * y), (0, 0.42), 0.032) for x, y in spots]
    model.shape("legs", "secondary", *legs)
    model.blocks("rungs", "secondary", [((0.2, 0.02, 0.02), (0, 0, 0.15)), ((0.02, 0.2, 0.02), (0, 0, 0.15))])
    model.solid((0.24, 0.24, 0.415))
    return model


def _round_table(name: str, diameter: float, height: float, wood: str, shelf: float) -> Model:
    """Return a round table on three legs with a smaller round board at height ``shelf``."""
    model = Model(name, primary=wood, secondary=wood)
    radius, top = diameter / 2, 0.035
    model.shape("top", "primary", cylinder(radius, top, 16).moved(z=height - top))
    model.solid_round(radius, top, (0, 0, height - top))
    model.shape("board", "primary", cylinder(0.75 * radius, 0.02, 12).moved(z=shelf))
    model.solid_round(0.75 * radius, 0.02, (0, 0, shelf))
    legs = [(0.78 * radius * np.cos(a), 0.78 * radius * np.sin(a)) for a in np.radians((60, 180, 300))]
    model.shape("legs", "secondary", *(cylinder(0.02, height - top, 6).moved(x, y) for x, y in legs))
    for x, y in legs:
        model.solid((0.035, 0.035, height - top), (x, y, 0))
    return model


def _pedestal_table(name: str, diameter: float, height: float) -> Model:
    """Return a round table on one turned column with a cross foot."""
    model = Model(name, primary="walnut", secondary="walnut")
    radius, top = diameter / 2, 0.035
    model.shape("top", "primary", cylinder(radius, top, 18).moved(z=height - top))
    model.solid_round(radius, top, (0, 0, height - top))
    model.shape("column", "secondary", cylinder(0.08, height - top - 0.05, 8, top=0.05).moved(z=0.05))
    model.solid_round(0.065, height - top - 0.05, (0, 0, 0.05))
    model.blocks("foot", "secondary", [((0.7, 0.08, 0.05), (0, 0, 0)), ((0.08, 0.7, 0.05), (0, 0, 0))], solid=True)
    return model


def _legs(model: Model, size: tuple[float, float, float], width: float, inset: float) -> None:
    """Add four square legs under a top of (x, y) at height z."""
    legs = [((width, width, size[2]), (x, y, 0.0)) for x, y in corners_of(size[0], size[1], width, inset)]
    model.blocks("legs", "secondary", legs, solid=True)
