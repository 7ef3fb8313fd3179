"""A whole home from a seed: plan, doors, colours and furniture as the layout that the assembler builds."""

from collections.abc import Sequence

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.generate.doors import Doorway, draw_doors
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.free_floor import WALL
from chmarl_pb.homes.generate.furnish import furnish
from chmarl_pb.homes.generate.looks import Looks, channels, draw_looks
from chmarl_pb.homes.generate.names import home_name
from chmarl_pb.homes.generate.plan import Plan, draw_plan, in_metres
from chmarl_pb.homes.generate.rooms import rooms_of
from chmarl_pb.homes.layout import Door, Furniture, Layout, Room
from chmarl_pb.homes.object_looks import SETS

_HEIGHT = 2.5
_LOOKS, _PLAN, _FURNITURE = 1, 2, 3  # streams of a seed; its rooms are drawn from another
_MOST_PLANS, _MOST_FURNISHINGS = 100, 3


def draw_layout(seed: int) -> Layout:
    """Return the layout of the home of a seed.

    Raises:
        HomeError: no attempt gives a home.
    """
    rooms = rooms_of(seed)
    for attempt in range(_MOST_PLANS):
        layout = _attempt(seed, rooms, attempt)
        if layout is not None:
            return layout
    raise HomeError(f"seed {seed}: no home in {_MOST_PLANS} attempts; use another seed")


def _attempt(seed: int, rooms: tuple[str, ...], attempt: int) -> Layout | None:
    draws = Draws(seed, _PLAN, attempt)
    plan = draw_plan(rooms, draws)
    doors = draw_doors(plan, draws) if plan else None
    if plan is None or doors is None:
        return None
    looks = draw_looks(tuple(plan), Draws(seed, _LOOKS))
    for furnishing in range(_MOST_FURNISHINGS):
        furniture = furnish(plan, doors, looks, Draws(seed, _FURNITURE, attempt, furnishing))
        if furniture is not None:
            return _layout(seed, plan, doors, looks, furniture)
    return None


def _layout(seed: int, plan: Plan, doors: Sequence[Doorway], looks: Looks, furniture: tuple[Furniture, ...]) -> Layout:
    rooms = tuple(
        Room(room, rects, channels(looks.floor(room)), channels(looks.paint[room]))
        for room, rects in in_metres(plan).items()
    )
    openings = tuple(
        Door(door.between, (door.position[0] / 100, door.position[1] / 100), door.width / 100) for door in doors
    )
    return Layout(home_name(seed), _HEIGHT, WALL / 100, rooms, openings, furniture, object_looks=seed % SETS)
