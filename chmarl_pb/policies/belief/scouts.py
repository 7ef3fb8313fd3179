"""The common plan of the robots that fly: it follows from the instruction and the messages alone.

So every robot of the team knows where the others look, and what it means that no message came of it.
"""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.policies.belief.knowledge import OVERLOOKED, Find
from chmarl_pb.policies.belief.statistics import FLIGHT_NUMBERS, FLIGHTS, REACH, Bits, Spots, Statistics

STAY = "stay"
MOVES = {"move_forward": (0, 1), "move_backward": (0, -1), "move_right": (1, 0), "move_left": (-1, 0)}
_SHARES = 1.0, 0.5  # what finding X and finding Y counts
_DEPTH, _WIDTH = 4, 4  # steps of a plan, and plans that are tried further

Place = tuple[int, tuple[int, int]]  # number of a room, and how far to the right and forward of its anchor


class _Route(NamedTuple):
    """A plan so far: what is left unseen, summed over its steps, the steps, and what is left after them."""

    missed: float
    steps: list[tuple[str, Place]]
    left: NDArray[np.float64]


class Scouts:
    """Where the robots that fly have looked, and what they do next; each robot keeps an account of its own.

    Attributes:
        flown: (2, rooms) bit for each of ``FLIGHTS`` from which they looked for X, and for Y, in vain.
        finds: the view by which they found X, and Y, if they did.
        actions: robot -> name of the action that it takes now.
    """

    def __init__(self, names: Sequence[str], statistics: Statistics, several: bool = False):
        """Begin an episode.

        Args:
            names: of the robots that fly.
            statistics: what is expected of homes.
            several: whether the instruction is of several objects, so that messages do not end the search.
        """
        rooms = len(statistics.rooms)
        self._rooms, self._several = statistics.rooms, several
        self.flown: Bits = np.zeros((2, rooms), dtype=np.int64)
        self.finds: list[Find | None] = [None, None]
        self.actions = dict.fromkeys(names, STAY)
        self._looked: Bits = np.zeros((2, rooms), dtype=np.int64)
        self._heard = np.zeros((2, rooms), dtype=bool)
        self._places: dict[str, Place | None] = dict.fromkeys(names)
        self._plans: dict[str, list[tuple[str, Place]]] = {name: [] for name in names}

    def place(self, name: str) -> Place | None:
        """Return where a robot is, as far as its own actions tell."""
        return self._places[name]

    def hear(self, heard: NDArray[np.bool_]) -> None:
        """Note what messages say after a step: (2, rooms) whether X, and Y, has been seen there."""
        new = heard & ~self._heard
        for name, place in self._places.items():
            if place is not None and self.actions[name] != STAY:
                room, flight = place[0], FLIGHT_NUMBERS[place[1]]
                self._looked[:, room] |= 1 << flight
                for row in (0, 1):
                    if new[row, room]:
                        self.finds[row] = Find(room, flight)
                    elif not heard[row].any():
                        self.flown[row, room] |= 1 << flight
        if new.any():
            self._plans = {name: [] for name in self._plans}
        self._heard = heard.copy()

    def decide(self, spots: tuple[Spots, Spots]) -> None:
        """Choose the next actions; ``spots`` are where X and Y may be."""
        if self._heard.any(axis=1).all() and not self._several:
            self.actions = dict.fromkeys(self.actions, STAY)
            return
        for name, plan in self._plans.items():
            if not plan:
                views, chance = self._unseen(spots)
                for place in self._others(name):
                    chance = chance * (1 - views[_view(place)])
                plan.extend(self._plan(self._places[name], views, chance))
            self.actions[name], self._places[name] = plan.pop(0)

    def _others(self, name: str) -> Iterator[Place]:
        """Yield where the others are, and where they are going to."""
        for other, plan in self._plans.items():
            if other != name:
                yield from (place for place in (self._places[other], *(place for _, place in plan)) if place)

    def _unseen(self, spots: tuple[Spots, Spots]) -> tuple[NDArray[np.float32], NDArray[np.float64]]:
        """Return what each view shows, (rooms * flights, n) of n sets of like spots, and what finding each counts."""
        keys, weights = [], []
        for row, (room, _, _, _, above, weight) in enumerate(spots):
            if self._several or not self._heard[row].any():
                looked = self._looked[row, room]
                keys.append((room << len(FLIGHTS)) + (above & ~looked))
                weights.append(_SHARES[row] * weight / weight.sum() * np.where(above & looked, OVERLOOKED, 1.0))
        sets, which = np.unique(np.concatenate(keys), return_inverse=True)
        shown = sets >> np.arange(len(FLIGHTS))[:, None] & 1
        rooms = sets >> len(FLIGHTS) == np.arange(len(self._rooms))[:, None]
        views = (rooms[:, None] * shown).reshape(-1, len(sets)).astype(np.float32)
        return views, np.bincount(which, np.concatenate(weights)).astype(np.float64)

    def _plan(
        self, start: Place | None, views: NDArray[np.float32], chance: NDArray[np.float64]
    ) -> list[tuple[str, Place]]:
        """Return the steps that leave least unseen, by a beam search."""
        beam = [_Route(0.0, [], chance)]
        for _ in range(_DEPTH):
            routes: dict[tuple[float, Place], tuple[_Route, str]] = {}
            for route in beam:
                gains, total = views @ route.left, float(route.left.sum())
                for action, place in self._steps(route.steps[-1][1] if route.steps else start):
                    missed = round(route.missed + total - float(gains[_view(place)]), 9)
                    routes.setdefault((missed, place), (route, action))
            beam = [
                _Route(missed, [*route.steps, (action, place)], route.left * (1 - views[_view(place)]))
                for (missed, place), (route, action) in sorted(routes.items(), key=lambda item: item[0])[:_WIDTH]
            ]
        return beam[0].steps

    def _steps(self, place: Place | None) -> Iterator[tuple[str, Place]]:
        """Yield the actions of a robot that flies, and where they lead."""
        for number, room in enumerate(self._rooms):
            yield f"goto_{room}", (number, (0, 0))
        if place is not None:
            here, (right, forward) = place
            for action, (x, y) in MOVES.items():
                if max(abs(right + x), abs(forward + y)) <= REACH:
                    yield action, (here, (right + x, forward + y))


def _view(place: Place) -> int:
    """Return the number of a view."""
    return place[0] * len(FLIGHTS) + FLIGHT_NUMBERS[place[1]]
