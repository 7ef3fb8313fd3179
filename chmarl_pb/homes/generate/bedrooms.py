"""Bedrooms: the bed with its head at a wall and nightstands beside it, a wardrobe, chests and a desk."""

from chmarl_pb.homes.generate.desks import desk
from chmarl_pb.homes.generate.extras import Extra, put_alone, put_extras
from chmarl_pb.homes.generate.groups import Group, Piece, at_wall, extent, group, wide
from chmarl_pb.homes.generate.site import Site

_NIGHTSTANDS = ("nightstand_drawer", "nightstand_round")
_DRESSERS = ("dresser_wide", "dresser_tall")
_WARDROBES = ("wardrobe_three", "wardrobe_two")
_BESIDE = 70  # free floor beside and before a bed
_MAY = (
    Extra(50, ("bench_upholstered", "bench_wood"), "any"),
    Extra(30, ("bookshelf_low", "bookshelf_tall")),
    Extra(25, ("mirror_standing",), gap=5),
    Extra(35, ("plant_tall",), gap=5),
    Extra(25, ("floor_lamp_shade",), gap=5),
    Extra(15, ("stool_wood", "chair_armchair"), gap=5),
)


def bedroom(site: Site) -> bool:
    """Put in what a bedroom must have; tell whether it fits."""
    double = site.room == "bedroom" or site.draws.chance(45)
    tables = site.draws.one_of((2, 2, 1)) if double else 1
    sizes = ((double, tables), (double, 1), (False, 1))
    placed = any(site.against_wall(_bed(site, *size), "middle") for size in sizes)
    return placed and any(put_alone(site, model, "corner") for model in site.draws.shuffled(_WARDROBES))


def more(site: Site) -> None:
    """Put in what a bedroom may have."""
    if site.draws.chance(95):
        _dresser(site)
    if site.draws.chance(60):
        desk(site)
    put_extras(site, _MAY)


def _bed(site: Site, double: bool, tables: int) -> Group:
    """Return a bed with nightstands and perhaps a rug."""
    model = "bed_double" if double else "bed_single"
    bed, table = at_wall(model), site.draws.one_of(_NIGHTSTANDS)
    half, beside = wide(model) // 2, wide(table) // 2
    sides = (-1, 1)[:tables]
    stands = [at_wall(table, side * (half + beside + 4)) for side in sides]
    foot = bed.front(_BESIDE)
    strip = extent(table).x1 - extent(table).x0, bed.area[3]
    lanes = [(half, strip[0], half + _BESIDE, strip[1]), (-half - _BESIDE, strip[0], -half, strip[1])]
    keep = [foot, *(lanes if double else lanes[1:])]
    rugs = []
    if site.draws.chance(65):
        rugs = [Piece("rug_rect", 0, bed.v + 45, 0) if double else Piece("rug_round", 0, bed.v + 55)]
    return group(*rugs, bed, *stands, keep=keep)


def _dresser(site: Site) -> bool:
    """Put in a chest of drawers, perhaps with a lamp on it and a mirror over it."""
    draws = site.draws
    for model in draws.shuffled(_DRESSERS):
        chest, high = at_wall(model), extent(model).height
        extras: list[Piece] = []
        if model == "dresser_wide":
            if draws.chance(70):
                extras.append(at_wall("table_lamp_shade", draws.one_of((-45, 45)), z=high, gap=8))
            if draws.chance(40):
                extras.append(at_wall("mirror_wall", z=high + 25))
        if site.against_wall(group(chest, *extras)):
            return True
    return False
