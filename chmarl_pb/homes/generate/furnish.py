"""Furnish a floor plan: room by room what each must have, then what it may have, then what hangs on the walls."""

from collections.abc import Callable, Sequence

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.homes.furniture import load_model
from chmarl_pb.homes.generate import bathrooms, bedrooms, hallways, kitchens, livingrooms
from chmarl_pb.homes.generate.dining import dining
from chmarl_pb.homes.generate.doors import Doorway
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.free_floor import FreeFloor
from chmarl_pb.homes.generate.looks import Looks
from chmarl_pb.homes.generate.plan import Plan
from chmarl_pb.homes.generate.site import MOST, Site
from chmarl_pb.homes.generate.spots import stretches
from chmarl_pb.homes.generate.wall_things import pictures, radiator, windows
from chmarl_pb.homes.layout import Furniture

LEAST_CLASSES = 12
"""Classes of receptacles in each home."""

_LIT = ("livingroom", "bedroom", "kitchen")  # kinds that must have a window
_PIECES_LEFT = 8  # below so many pieces a room gets only what it must have

_MUST: dict[str, Callable[[Site], bool]] = {
    "livingroom": livingrooms.livingroom,
    "kitchen": kitchens.kitchen,
    "bedroom": bedrooms.bedroom,
    "bathroom": bathrooms.bathroom,
    "hallway": hallways.hallway,
}
_MAY: dict[str, Callable[[Site], None]] = {
    "livingroom": livingrooms.more,
    "kitchen": kitchens.more,
    "bedroom": bedrooms.more,
    "bathroom": bathrooms.more,
    "hallway": hallways.more,
}


def furnish(plan: Plan, doors: Sequence[Doorway], looks: Looks, draws: Draws) -> tuple[Furniture, ...] | None:
    """Return the furniture of a floor plan, or None where what it must have does not fit."""
    floor, things = FreeFloor(plan, doors), list[Furniture]()
    sites = [
        Site(room, boxes, stretches(plan, doors, room), floor, looks, draws, things) for room, boxes in plan.items()
    ]
    if not all(_MUST[site.kind](site) for site in sites):
        return None
    if not _dine(sites):
        return None
    if not all(windows(site) or site.kind not in _LIT for site in sites):
        return None
    for site in draws.shuffled(sites):
        if len(things) + _PIECES_LEFT <= MOST:
            _MAY[site.kind](site)
    classes = {load_model(thing.model).thing_class for thing in things}
    if len(classes & BENCHMARK.receptacles.keys()) < LEAST_CLASSES:
        return None
    for site in draws.shuffled(sites):
        left = MOST - len(things)
        if left > 0:
            pictures(site, min(draws.between(1, 2), left))
        if draws.chance(20):
            radiator(site)
    return tuple(_in_order(plan, things))


def _dine(sites: Sequence[Site]) -> bool:
    """Put a table with chairs into the kitchen or the living room."""
    rooms = [site for site in sites if site.kind in ("kitchen", "livingroom")]
    order = sites[0].draws.shuffled(rooms)
    return any(dining(site, rug=site.kind == "livingroom" and site.draws.chance(40)) for site in order)


def _in_order(plan: Plan, things: Sequence[Furniture]) -> list[Furniture]:
    """Return the furniture room by room."""
    return [thing for room in plan for thing in things if thing.room == room]
