"""What homes of training teach: which receptacles stand in which kind of room, and which views show what.

``python -m tools.build_belief`` measures it. A view of a robot that drives is told by its turns (of 30 degrees
to the left) since it came to a room's anchor, one of a robot that flies by how far it has moved from there.
"""

import json
from collections.abc import Collection, Iterator, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, room_kind
from chmarl_pb.tasks.splits import homes_of

FILE = Path(__file__).parent / "statistics.json"
TURNS = 12
#: Moves of a robot that flies from a room's anchor, along each axis at most.
REACH = 2
#: Where it comes by them: moves to the right and forward, in the order of the bits of masks.
FLIGHTS = tuple((x, y) for x in range(-REACH, REACH + 1) for y in range(-REACH, REACH + 1))
FLIGHT_NUMBERS = {flight: number for number, flight in enumerate(FLIGHTS)}

Bits = NDArray[np.int64]
_RECEPTACLES = {name: number for number, name in enumerate(BENCHMARK.receptacles)}


class Spots(NamedTuple):
    """Where a thing may be: places in the rooms of the homes of training, as if they were this home's.

    Attributes:
        room: (n,) number of the room.
        layout: (n,) number of the layout, which is one home's furniture of a room.
        support: (n,) number of the class of the receptacle that is or carries the thing.
        near: (n,) bit for each turn at the room's anchor after which it is in view.
        above: (n,) bit for each of ``FLIGHTS`` from which it is in view.
        weight: (n,) how often a thing is there, in any unit.
    """

    room: Bits
    layout: Bits
    support: Bits
    near: Bits
    above: Bits
    weight: NDArray[np.float64]


class Statistics(NamedTuple):
    """The statistics for a home with certain rooms.

    Attributes:
        rooms: names of the rooms.
        layouts: (layouts,) number of the room of each layout.
        homes: (layouts,) 1 and so on for the homes of training that each is of, 0 for all generated ones.
        shown: (layouts, TURNS) classes of receptacles in view after so many turns, a bit for each class.
        furniture: (layouts,) classes of receptacles in the room.
        objects: where objects may stand.
        receptacles: where receptacles may stand.
    """

    rooms: tuple[str, ...]
    layouts: Bits
    homes: Bits
    shown: Bits
    furniture: Bits
    objects: Spots
    receptacles: Spots

    def objects_off(self, targets: Collection[str]) -> Spots:
        """Return where an object may be that is to be brought to a receptacle of these classes: not yet there."""
        barred = [_RECEPTACLES[name] for name in targets if name in _RECEPTACLES]
        weight = np.where(np.isin(self.objects.support, barred), 0.0, self.objects.weight)
        return self.objects._replace(weight=weight)

    def receptacles_of(self, targets: Collection[str]) -> Spots:
        """Return where receptacles of these classes may be; anywhere, if the statistics know none of them."""
        room, layout, support, near, above, weight = self.receptacles
        chosen = self.is_of(targets)
        return Spots(room[chosen], layout[chosen], support[chosen], near[chosen], above[chosen], weight[chosen])

    def is_of(self, targets: Collection[str]) -> NDArray[np.bool_]:
        """Return which of the receptacles are of these classes; all, if they know none of them."""
        wanted = [_RECEPTACLES[name] for name in targets if name in _RECEPTACLES]
        chosen = np.isin(self.receptacles.support, wanted)
        return chosen if chosen.any() else ~chosen


def class_bits(names: Collection[str]) -> int:
    """Return the bits of some classes; those that are no receptacles have none."""
    return sum(1 << _RECEPTACLES[name] for name in set(names) if name in _RECEPTACLES)


@cache
def statistics(rooms: tuple[str, ...]) -> Statistics:
    """Return the statistics for a home with these rooms; a room of an unknown kind may be like any."""
    likes = [(number, home, things) for number, room in enumerate(rooms) for home, things in _like(room_kind(room))]
    layouts = [(number, things) for number, _, things in likes]
    shown = [[class_bits([*_in_view(things, turn)]) for turn in range(TURNS)] for _, things in layouts]
    furniture = [class_bits([thing["class"] for thing in things]) for _, things in layouts]
    counts = np.bincount([room for room, _ in layouts])
    objects, receptacles = [], []
    for layout, (room, things) in enumerate(layouts):
        for thing in things:
            where, weight = (room, layout, _RECEPTACLES[thing["class"]]), thing["weight"] / counts[room]
            receptacles.append((*where, thing["near"], thing["above"], weight))
            seen = sum(count for *_, count in thing["objects"])
            objects += [(*where, near, above, weight * count / seen) for near, above, count in thing["objects"]]
    return Statistics(
        rooms, np.array([room for room, _ in layouts]), np.array([home for _, home, _ in likes]), np.array(shown),
        np.array(furniture), _spots(objects), _spots(receptacles),
    )  # fmt: skip


def _like(kind: str) -> list[tuple[int, list[dict[str, Any]]]]:
    """Return what stands in each room of a kind, or of any if there is none of it, and the number of its home."""
    numbers = [number if number <= len(homes_of("train")) else 0 for number in range(1, len(_read()) + 1)]
    homes = zip(numbers, _read(), strict=True)
    known = [(room_kind(room), number, things) for number, home in homes for room, things in home.items()]
    return [row[1:] for row in known if row[0] == kind] or [row[1:] for row in known]


def _in_view(things: list[dict[str, Any]], turn: int) -> Iterator[str]:
    return (thing["class"] for thing in things if thing["near"] >> turn & 1)


def _spots(rows: Sequence[tuple[float, ...]]) -> Spots:
    *numbers, weight = np.array(rows).T
    room, layout, support, near, above = (column.astype(np.int64) for column in numbers)
    return Spots(room, layout, support, near, above, weight)


@cache
def _read() -> list[dict[str, list[dict[str, Any]]]]:
    """Return for each home of training room -> its receptacles."""
    homes: list[dict[str, list[dict[str, Any]]]] = json.loads(FILE.read_text(encoding="utf-8"))
    return homes
