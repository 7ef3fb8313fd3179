"""The common plan of the robots that fly: it follows from the instruction and the messages alone.

So every robot of the team knows where the others look, and what it means that no message came of it.
"""

from collections.abc import Collection, Iterator, Sequence
from functools import cache, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.blas import one_thread
from chmarl_pb.policies.belief.knowledge import OVERLOOKED, Find
from chmarl_pb.policies.belief.statistics import FLIGHT_NUMBERS, FLIGHTS, REACH, Bits, Statistics, statistics
from chmarl_pb.policies.code import UNKNOWN

STAY = "stay"
MOVES = {"move_forward": (0, 1), "move_backward": (0, -1), "move_right": (1, 0), "move_left": (-1, 0)}
_SHARES = 1.0, 0.5  # what finding X and finding Y counts
_DEPTH, _WIDTH = 8, 16  # steps that are looked ahead, and plans that are tried further
_FIRM = 4  # steps of them that become the plan: the last ones are taken for want of a further view
_AHEAD = 4  # steps that are always planned
_SOON = 2  # steps in which a direction follows a room, if it is known

Place = tuple[int, tuple[int, int]]  # number of a room, and how far to the right and forward of its anchor
Steps = tuple[tuple[str, Place], ...]


class Scouts:
    """Where the robots that fly have looked, and what they do next; each robot keeps an account of its own.

    Attributes:
        flown: (2, rooms) bit for each of ``FLIGHTS`` from which they looked for X, and for Y, in vain.
        finds: the view by which they found X, and Y, if they did.
        actions: robot -> name of the action that it takes now.
    """

    def __init__(
        self, names: Sequence[str], expected: Statistics, targets: Collection[str], several: bool = False
    ):  # fmt: skip
        """Begin an episode.

        Args:
            names: of the robots that fly.
            expected: what is expected of homes.
            targets: the classes of Y.
            several: whether the instruction is of several objects, so that messages do not end the search.
        """
        rooms = len(expected.rooms)
        self._rooms, self._targets, self._several = expected.rooms, frozenset(targets), several
        self.flown: Bits = np.zeros((2, rooms), dtype=np.int64)
        self.finds: list[Find | None] = [None, None]
        self.actions = dict.fromkeys(names, STAY)
        self._visited: set[tuple[int, int]] = set()  # 0 for X, 1 for Y, and a room that it has looked into for it
        self._looked: Bits = np.zeros(rooms, dtype=np.int64)
        self._heard = np.zeros((2, rooms), dtype=bool)
        self._undirected = np.zeros((2, rooms), dtype=np.int64)  # steps for which a room has been known, no direction
        self._places: dict[str, Place | None] = dict.fromkeys(names)
        self._before = dict(self._places)  # where they were before their present actions
        self._plans: dict[str, list[tuple[str, Place]]] = {name: [] for name in names}

    def place(self, name: str) -> Place | None:
        """Return where a robot is, as far as its own actions tell."""
        return self._places[name]

    def before(self, name: str) -> Place | None:
        """Return where a robot was before the action that has been decided."""
        return self._before[name]

    def hear(self, heard: NDArray[np.bool_], bearings: NDArray[np.float64] | None = None) -> None:
        """Note what messages say after a step.

        Args:
            heard: (2, rooms) whether X, and Y, has been seen there.
            bearings: (2, rooms) in which direction, ``UNKNOWN`` if that has not been told; None if it never is.
        """
        if bearings is not None:
            self._undirected = np.where(heard & (bearings == UNKNOWN), self._undirected + 1, 0)
        new = heard & ~self._heard
        for name, place in self._places.items():
            if place is not None and self.actions[name] != STAY:
                room, flight = place[0], FLIGHT_NUMBERS[place[1]]
                self._looked[room] |= 1 << flight
                for row in (0, 1):
                    if new[row, room]:
                        self.finds[row] = Find(room, flight)
                    elif not heard[row].any():
                        self.flown[row, room] |= 1 << flight
        if new.any():
            self._plans = {name: [] for name in self._plans}
        self._heard = heard.copy()

    def decide(self) -> None:
        """Choose the next actions."""
        self._before = dict(self._places)
        open_rows = tuple(self._several or not row.any() for row in self._heard)
        room = self._to_point(open_rows)
        for name, plan in self._plans.items():
            if room is not None:
                self.actions[name], self._places[name], room = f"goto_{self._rooms[room]}", (room, (0, 0)), None
                plan.clear()
            elif any(open_rows):
                self._extend(name, plan, open_rows)
                self.actions[name], self._places[name] = plan.pop(0)
            else:
                self.actions[name] = STAY

    def _to_point(self, open_rows: tuple[bool, ...]) -> int | None:
        """Return the room to look into, once, as it is not known in which direction X or Y is there: X comes first."""
        for row in (0, 1):
            waiting = np.flatnonzero(self._undirected[row] >= _SOON).tolist()
            if open_rows[0] or (row and open_rows[1]):
                return None
            for room in waiting:
                if (row, room) not in self._visited:
                    self._visited.add((row, room))
                    return int(room)
        return None

    def _extend(self, name: str, plan: list[tuple[str, Place]], open_rows: tuple[bool, ...]) -> None:
        """Plan on for a robot."""
        while len(plan) <= _AHEAD:
            start = plan[-1][1] if plan else self._places[name]
            taken = tuple(sorted({_view(place) for place in self._taken(name)}))
            plan.extend(_plan(self._rooms, self._targets, open_rows, tuple(self._looked.tolist()), taken, start))

    def note(self, name: str, action: str) -> None:
        """Go on from what a robot has done, if that was something else than the plan."""
        if action != self.actions[name]:
            before = self._before[name]
            self.actions[name], self._plans[name] = action, []
            self._places[name] = before if action == STAY else dict(_steps(self._rooms, before)).get(action)

    def _taken(self, name: str) -> Iterator[Place]:
        """Yield where all are going to, and where the others are."""
        for other, plan in self._plans.items():
            if other != name and (here := self._places[other]):
                yield here
            yield from (place for _, place in plan)

    def expected(self, row: int, late: float) -> NDArray[np.float64]:
        """Return the steps after which X, or Y, is seen at each of the spots; ``late`` if that is not planned."""
        shows = _shows(self._rooms)
        steps = np.full(shows.views.shape[1], late)
        if self._several or not self._heard[row].any():
            for name, plan in self._plans.items():
                if self.actions[name] != STAY:
                    places = [self._places[name], *(place for _, place in plan)]
                    for step, place in reversed(list(enumerate(places, 1))):
                        if place is not None:
                            steps[shows.views[_view(place)] > 0] = step
        return steps[shows.sets[row]]


class _Shows(NamedTuple):
    """What views from above show.

    Attributes:
        views: (rooms * flights, n) 1 where a view shows a set of like spots.
        sets: of objects, and of receptacles: (spots,) number of the set.
    """

    views: NDArray[np.float32]
    sets: tuple[Bits, Bits]


@cache
def _shows(rooms: tuple[str, ...]) -> _Shows:
    """Return what views from above show in a home with these rooms."""
    expected = statistics(rooms)
    keys = [(spots.room << len(FLIGHTS)) + spots.above for spots in (expected.objects, expected.receptacles)]
    sets, which = np.unique(np.concatenate(keys), return_inverse=True)
    shown = sets >> np.arange(len(FLIGHTS))[:, None] & 1
    there = sets >> len(FLIGHTS) == np.arange(len(rooms))[:, None]
    views = (there[:, None] * shown).reshape(-1, len(sets)).astype(np.float32)
    return _Shows(views, (which[: len(keys[0])], which[len(keys[0]) :]))


@lru_cache(maxsize=2**13)
def _plan(
    rooms: tuple[str, ...], targets: frozenset[str], open_rows: tuple[bool, ...], looked: tuple[int, ...],
    taken: tuple[int, ...], start: Place | None,
) -> Steps:  # fmt: skip
    """Return the first steps of the way that leaves least unseen, by a beam search.

    Args:
        rooms: names of the rooms.
        targets: the classes of Y.
        open_rows: whether X, and Y, is looked for.
        looked: for each room, a bit for each of ``FLIGHTS`` from which robots have looked.
        taken: views that are planned already.
        start: where the robot is then.
    """
    shows = _shows(rooms)
    done = [room * len(FLIGHTS) + flight for room, bits in enumerate(looked) for flight in _set_bits(bits)]
    views, left = shows.views.copy(), _worth(rooms, targets, open_rows)
    left = left * np.where(views[done].any(axis=0), OVERLOOKED, 1.0).astype(np.float32)
    left[views[list(taken)].any(axis=0)] = 0
    views[done] = 0
    beam: list[tuple[float, Steps]] = [(0.0, ())]
    remains = left[None]
    for _ in range(_DEPTH):
        with one_thread():
            gains = remains @ views.T
        misses = (remains.sum(axis=1)[:, None] - gains).tolist()
        ways: dict[tuple[float, Place], tuple[int, str]] = {}
        for number, (missed, steps) in enumerate(beam):
            for action, place in _steps(rooms, steps[-1][1] if steps else start):
                value = missed + misses[number][_view(place)]
                ways.setdefault((round(value, 6), place), (number, action))
        chosen = sorted(ways.items(), key=lambda way: way[0])[:_WIDTH]
        remains = np.stack([remains[number] * (1 - views[_view(place)]) for (_, place), (number, _) in chosen])
        beam = [(missed, (*beam[number][1], (action, place))) for (missed, place), (number, action) in chosen]
    return beam[0][1][:_FIRM]


@lru_cache(maxsize=64)
def _worth(rooms: tuple[str, ...], targets: frozenset[str], open_rows: tuple[bool, ...]) -> NDArray[np.float32]:
    """Return what finding X and Y in each set of spots counts."""
    shows, expected = _shows(rooms), statistics(rooms)
    total = np.zeros(shows.views.shape[1])
    weights = expected.objects_off(targets).weight, np.where(expected.is_of(targets), expected.receptacles.weight, 0.0)
    for is_open, share, sets, weight in zip(open_rows, _SHARES, shows.sets, weights, strict=True):
        if is_open:
            total += np.bincount(sets, share * weight / weight.sum(), minlength=len(total))
    return total.astype(np.float32)


def _set_bits(bits: int) -> Iterator[int]:
    return (number for number in range(len(FLIGHTS)) if bits >> number & 1)


@lru_cache(maxsize=1024)
def _steps(rooms: tuple[str, ...], place: Place | None) -> Steps:
    """Return the actions of a robot that flies, and where they lead."""
    steps: list[tuple[str, Place]] = [(f"goto_{room}", (number, (0, 0))) for number, room in enumerate(rooms)]
    if place is not None:
        here, (right, forward) = place
        for action, (x, y) in MOVES.items():
            if max(abs(right + x), abs(forward + y)) <= REACH:
                steps.append((action, (here, (right + x, forward + y))))
    return tuple(steps)


@cache
def _view(place: Place) -> int:
    """Return the number of a view."""
    return place[0] * len(FLIGHTS) + FLIGHT_NUMBERS[place[1]]
