"""Large scenery of the living room: television, piano, fireplace and radiator."""

from tools.assets.furniture_model import Model, panel
from tools.assets.meshes import box, lathe, tube


def models() -> list[Model]:
    """Return the models of this group."""
    return [tv_flat(), piano_upright(), fireplace_stone(), radiator_white()]


def tv_flat() -> Model:
    """Return a flat television on its foot."""
    model = Model("tv_flat", primary="black", secondary="screen")
    model.block("primary", (0.04, 1.2, 0.69), (0, 0, 0.06))
    model.block("secondary", (0.006, 1.16, 0.64), (0.021, 0, 0.09), solid=False)
    shine = [(-0.5, 0.2), (-0.35, 0.2), (-0.05, 0.68), (-0.2, 0.68)]
    model.shape("shine", "charcoal", panel(shine, 0.024, 0.003))
    model.block("dark_steel", (0.1, 0.4, 0.015), solid=False)
    model.block("dark_steel", (0.03, 0.08, 0.06), (-0.01, 0, 0.01), solid=False)
    model.solid((0.1, 0.4, 0.06))
    return model


def piano_upright() -> Model:
    """Return an upright piano: keys, music with a sheet on it, pedals."""
    model = Model("piano_upright", primary="mahogany", secondary="ceramic")
    model.block("primary", (0.3, 1.5, 1.17), (-0.15, 0, 0))
    model.block("primary", (0.34, 1.5, 0.03), (-0.13, 0, 1.17))
    model.block("primary", (0.3, 1.5, 0.1), (0.15, 0, 0.58))
    model.blocks("arms", "primary", [((0.3, 0.08, 0.09), (0.15, y, 0.68)) for y in (-0.71, 0.71)], solid=True)
    model.blocks("legs", "primary", [((0.07, 0.08, 0.58), (0.25, y, 0)) for y in (-0.71, 0.71)], solid=True)
    model.block("gap", (0.18, 1.34, 0.006), (0.18, 0, 0.68), solid=False)
    model.block("secondary", (0.15, 1.33, 0.024), (0.195, 0, 0.68), solid=False)
    steps = [i for i in range(21) if i % 7 not in (2, 6)]
    sharps = [box(0.09, 0.03, 0.02).moved(0.165, 0.0605 * (i - 10), 0.702) for i in steps]
    model.shape("sharps", "black", *sharps)
    model.block("brass", (0.01, 1.2, 0.012), (0.005, 0, 0.84), solid=False)
    model.block("secondary", (0.012, 0.42, 0.28), (0.01, 0, 0.852), solid=False)
    model.blocks("notes", "charcoal", [((0.003, 0.34, 0.01), (0.0175, 0, 0.9 + 0.07 * i)) for i in range(3)])
    model.blocks("pedals", "brass", [((0.08, 0.03, 0.015), (0.03, y, 0.04)) for y in (-0.08, 0, 0.08)])
    return model


def fireplace_stone() -> Model:
    """Return a stone fireplace with a wooden mantel, logs and flames."""
    model = Model("fireplace_stone", primary="stone", secondary="walnut")
    model.blocks("jambs", "primary", [((0.34, 0.32, 1.03), (-0.03, y, 0)) for y in (-0.45, 0.45)], solid=True)
    model.block("primary", (0.34, 0.58, 0.36), (-0.03, 0, 0.67))
    model.block("secondary", (0.4, 1.3, 0.07), (0, 0, 1.03))
    model.block("black", (0.04, 0.58, 0.67), (-0.18, 0, 0))
    model.block("dark_stone", (0.36, 0.58, 0.04), (0.02, 0, 0))
    logs = ([(0.0, -0.2, 0.08), (0.04, 0.2, 0.08)], [(-0.06, -0.18, 0.12), (0.05, 0.15, 0.14)])
    model.shape("logs", "walnut", *(tube(ends, 0.04, 6) for ends in logs))
    flame = lathe([(0.06, 0.0), (0.09, 0.08), (0.05, 0.2), (0, 0.34)], 6)
    flames = ((-0.1, 0.8), (0.04, 1.0), (0.14, 0.6))
    model.shape("fire", "fire", *(flame.scaled(0.7, 1, size).moved(0, y, 0.12) for y, size in flames))
    seams = [((0.006, 0.32, 0.014), (0.143, y, z)) for y in (-0.45, 0.45) for z in (0.24, 0.48, 0.72)]
    model.blocks("seams", "dark_stone", seams)
    return model


def radiator_white() -> Model:
    """Return a panel radiator with upright ribs."""
    model = Model("radiator_white", primary="white", secondary="grey")
    model.block("secondary", (0.06, 0.86, 0.5), (-0.02, 0, 0.07), solid=False)
    ribs = [((0.1, 0.05, 0.54), (0.01, 0.077 * (i - 5.5), 0.05)) for i in range(12)]
    model.blocks("ribs", "primary", ribs)
    model.blocks("feet", "secondary", [((0.06, 0.03, 0.06), (0, y, 0)) for y in (-0.3, 0.3)])
    model.block("primary", (0.12, 0.9, 0.02), (0, 0, 0.58), solid=False)
    model.solid((0.12, 0.9, 0.6))
    return model
