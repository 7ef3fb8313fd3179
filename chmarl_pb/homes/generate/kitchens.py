"""Kitchens: counters, stove and fridge in rows along the walls, a table or an island where there is room."""

from collections.abc import Sequence

from chmarl_pb.homes.generate.extras import Extra, put_extras
from chmarl_pb.homes.generate.groups import Piece, at_wall, group, wide
from chmarl_pb.homes.generate.site import Site

_GAP = 1
_HOOD, _UPPER = 160, 150  # heights of a hood and of wall cabinets
_UPPER_WIDTH = 120  # of wall cabinets
_LARGE = 1300  # square decimetres
_MAY = (
    Extra(50, ("trash_can_steel",), gap=4),
    Extra(60, ("cabinet_tall", "cabinet_low")),
    Extra(25, ("plant_tall",), gap=5),
)


def kitchen(site: Site) -> bool:
    """Put in what a kitchen must have; tell whether it fits."""
    draws = site.draws
    fridge = draws.one_of(("fridge_single", "fridge_single", "fridge_double"))
    stove = draws.one_of(("stove_gas", "stove_electric"))
    end = draws.one_of(("kitchen_counter_short", "kitchen_counter_short", "kitchen_counter_straight"))
    one_wall = [
        ((fridge, end, stove, "kitchen_counter_sink"),),
        ((fridge, "kitchen_counter_sink", stove, end),),
    ]
    corner = [
        (("kitchen_counter_sink", stove, end), (fridge,)),
        ((end, stove, "kitchen_counter_sink"), (fridge, "kitchen_counter_short")),
        ((end, stove, "kitchen_counter_short"), ("kitchen_counter_sink", fridge)),
        (("kitchen_counter_short", stove, end), (fridge, "kitchen_counter_sink")),
    ]
    small = [
        (("kitchen_counter_short", stove, "kitchen_counter_short"), ("kitchen_counter_sink",), (fridge,)),
        (("kitchen_counter_sink", stove), ("fridge_single", "kitchen_counter_short")),
        (("kitchen_counter_sink", stove), ("fridge_single",)),
    ]
    for rows in (*draws.shuffled([*one_wall, *corner]), *small):
        if _row(site, rows[0]):
            return all(_row(site, row) or _row(site, row[:1]) for row in rows[1:]) and site.count("fridge") > 0
    return False


def more(site: Site) -> None:
    """Put in what a kitchen may have."""
    _upper(site)
    if site.area > _LARGE and site.draws.chance(30):
        site.in_middle(group(Piece("kitchen_counter_island"), margin=85))
    if site.draws.chance(80):
        _microwave(site)
    put_extras(site, _MAY)


def _row(site: Site, models: Sequence[str]) -> bool:
    """Put pieces side by side against a wall, with a hood over the stove."""
    parts, along = [], 0
    for model in models:
        parts.append(at_wall(model, along + wide(model) // 2))
        if model.startswith("stove"):
            parts.append(at_wall("range_hood_steel", along + wide(model) // 2, z=_HOOD))
        along += wide(model) + _GAP
    return site.against_wall(group(*parts), "corner")


def _upper(site: Site) -> None:
    """Hang cabinets over counters."""
    for part, pose in list(site.parts):
        if part.thing_class == "kitchen_counter" and wide(part.model) > _UPPER_WIDTH and site.draws.chance(90):
            cabinet = at_wall("wall_cabinet_kitchen", part.u + site.draws.one_of((-25, 0, 25)), z=_UPPER)
            site.at(group(cabinet), pose)


def _microwave(site: Site) -> bool:
    """Put a microwave on the end of a counter."""
    for part, pose in site.parts:
        if part.model in ("kitchen_counter_straight", "kitchen_counter_short"):
            side = site.draws.one_of((-1, 1)) * (wide(part.model) // 2 - 30)
            return site.at(group(at_wall("microwave_steel", part.u + side, z=90, gap=5)), pose)
    return False
