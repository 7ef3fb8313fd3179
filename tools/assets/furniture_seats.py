"""Hard seats: dining and office chairs, and benches."""

import numpy as np

from tools.assets.furniture_model import Block, Model
from tools.assets.meshes import box, cylinder, rounded_box, tube


def models() -> list[Model]:
    """Return the models of this group."""
    return [chair_dining(), chair_office(), bench_wood(), bench_upholstered()]


def chair_dining() -> Model:
    """Return a wooden chair with a slatted back and a seat pad."""
    model = Model("chair_dining", primary="oak", secondary="linen")
    model.block("primary", (0.44, 0.44, 0.03), (0.01, 0, 0.41))
    model.shape("pad", "secondary", rounded_box(0.41, 0.4, 0.02, 0.05, bevel=0.01).moved(0.02, 0, 0.44))
    model.solid((0.41, 0.4, 0.02), (0.02, 0, 0.44))
    legs = [((0.04, 0.04, 0.41), (0.2, y, 0)) for y in (-0.2, 0.2)]
    posts = [((0.04, 0.04, 0.92), (-0.21, y, 0)) for y in (-0.2, 0.2)]
    model.blocks("legs", "primary", legs + posts, solid=True)
    slats = [((0.02, 0.36, 0.06), (-0.21, 0, z)) for z in (0.58, 0.71, 0.84)]
    model.blocks("slats", "primary", slats)
    model.solid((0.03, 0.36, 0.34), (-0.21, 0, 0.57))
    return model


def chair_office() -> Model:
    """Return a swivel chair on five castors."""
    model = Model("chair_office", primary="navy", secondary="charcoal")
    model.shape("seat", "primary", rounded_box(0.47, 0.48, 0.08, 0.09, steps=2, bevel=0.025).moved(0.035, 0, 0.4))
    model.solid((0.45, 0.46, 0.08), (0.035, 0, 0.4))
    back = rounded_box(0.5, 0.44, 0.06, 0.08, steps=2, bevel=0.02).turned("y", -np.pi / 2)
    model.shape("back", "primary", back.moved(-0.19, 0, 0.8))
    model.solid((0.06, 0.44, 0.5), (-0.22, 0, 0.55))
    feet = []
    for angle in np.arange(5) * 2 * np.pi / 5:
        end = np.array([0.25 * np.cos(angle), 0.25 * np.sin(angle), 0.05])
        feet += [tube(np.array([[0, 0, 0.1], end]), 0.02, 4), box(0.04, 0.04, 0.05).moved(end[0], end[1])]
    stem = cylinder(0.03, 0.32, 6).moved(z=0.08)
    model.shape("foot", "secondary", *feet, stem)
    model.block("secondary", (0.03, 0.08, 0.3), (-0.255, 0, 0.36), solid=False)
    arms = [((0.26, 0.05, 0.03), (0.0, y, 0.64)) for y in (-0.25, 0.25)]
    posts = [((0.03, 0.03, 0.24), (0.0, y, 0.4)) for y in (-0.25, 0.25)]
    model.blocks("arms", "secondary", arms + posts, solid=True)
    model.solid_round(0.265, 0.09)
    model.solid_round(0.04, 0.31, (0, 0, 0.09))
    return model


def bench_wood() -> Model:
    """Return a plain bench of three planks."""
    model = Model("bench_wood", primary="oak", secondary="walnut")
    planks = [((0.126, 1.2, 0.04), (x, 0, 0.41)) for x in (-0.137, 0, 0.137)]
    model.blocks("planks", "primary", planks)
    model.solid((0.4, 1.2, 0.04), (0, 0, 0.41))
    model.blocks("ends", "secondary", [((0.34, 0.06, 0.41), (0, y, 0)) for y in (-0.48, 0.48)], solid=True)
    model.block("secondary", (0.05, 0.9, 0.08), (0, 0, 0.18))
    return model


def bench_upholstered() -> Model:
    """Return a padded bench on brass legs."""
    model = Model("bench_upholstered", primary="teal", secondary="brass")
    model.shape("seat", "primary", rounded_box(0.45, 1.1, 0.13, 0.04, bevel=0.025).moved(z=0.34))
    model.solid((0.45, 1.1, 0.13), (0, 0, 0.34))
    legs: list[Block] = [((0.035, 0.035, 0.34), (x, y, 0)) for x in (-0.17, 0.17) for y in (-0.47, 0.47)]
    rails: list[Block] = [((0.34, 0.03, 0.03), (0, y, 0.05)) for y in (-0.47, 0.47)]
    model.blocks("legs", "secondary", legs + rails)
    for y in (-0.47, 0.47):
        model.solid((0.375, 0.035, 0.34), (0, y, 0))
    return model
