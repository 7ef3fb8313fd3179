"""Which rooms a home has, and what is asked of a room of each kind. Lengths in centimetres."""

from dataclasses import dataclass

from chmarl_pb.catalog import room_kind
from chmarl_pb.homes.generate.draws import Draws


@dataclass(frozen=True)
class RoomRule:
    """What is asked of the rooms of a kind.

    Attributes:
        opens_to: kinds of rooms that it may have its door to; the first that it touches is taken.
        shorter: least and greatest length of its shorter side.
        longer: the same of its longer side.
        area: least and greatest, in square decimetres.
        daylight: least length of outer walls.
        wing: likelihood in per cent that it gets a second part, which makes it an L.
    """

    opens_to: tuple[str, ...]
    shorter: tuple[int, int]
    longer: tuple[int, int]
    area: tuple[int, int]
    daylight: int
    wing: int = 0


RULES = {
    "hallway": RoomRule(("livingroom",), (175, 225), (350, 750), (600, 1500), 0, wing=30),
    "livingroom": RoomRule(("hallway",), (400, 525), (475, 725), (2100, 3200), 200, wing=45),
    "kitchen": RoomRule(("livingroom",), (325, 400), (375, 500), (1250, 1800), 175, wing=15),
    "bedroom": RoomRule(("hallway", "livingroom"), (350, 425), (375, 500), (1350, 1900), 175, wing=10),
    "bathroom": RoomRule(("hallway", "bedroom"), (250, 300), (275, 375), (720, 1050), 0),
}

_STREAM = 0  # of a seed, that its rooms are drawn from
_FOUR = ("livingroom", "kitchen", "bedroom", "bathroom")

#: More rooms than the four -> how often, in twentieths.
_MORE = {
    (): 5,
    ("hallway",): 6,
    ("bedroom_2",): 1,
    ("hallway", "bedroom_2"): 3,
    ("hallway", "bathroom_2"): 1,
    ("hallway", "bedroom_2", "bathroom_2"): 2,
    ("hallway", "bedroom_2", "bedroom_3"): 1,
    ("hallway", "bedroom_2", "bedroom_3", "bathroom_2"): 1,
}


def rule_of(room: str) -> RoomRule:
    """Return what is asked of a room."""
    return RULES[room_kind(room)]


def rooms_of(seed: int) -> tuple[str, ...]:
    """Return the rooms of the home of a seed in the order in which they are laid: quickly, without the home."""
    return draw_rooms(Draws(seed, _STREAM))


def draw_rooms(draws: Draws) -> tuple[str, ...]:
    """Return the rooms of a home in the order in which they are laid: each touches one before it that it may open to.

    Four to eight, with one each of kitchen, bedroom, bathroom and livingroom.
    """
    more = draws.one_of([rooms for rooms, count in _MORE.items() for _ in range(count)])
    first = [room for room in ("hallway", "livingroom", "kitchen") if room in (*_FOUR, *more)]
    bedrooms = [room for room in ("bedroom", *more) if room_kind(room) == "bedroom"]
    bathrooms = [room for room in ("bathroom", *more) if room_kind(room) == "bathroom"]
    head = first[:-1] if draws.chance(50) else first
    return (*head, *bedrooms, *bathrooms, *(() if head is first else first[-1:]))
