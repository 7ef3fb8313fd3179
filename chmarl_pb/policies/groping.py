"""A robot that points and sees nothing: it tries the cells where homes of training have things most often.

It knows its own room, whether it holds something, and the board, if there is one. What it has picked it brings to where
a Y is most likely; each time it has put something down, it goes on with the spots where it has not picked yet.
"""

from collections.abc import Sequence

import numpy as np

from chmarl_pb.policies.narrow_views import BlindView
from chmarl_pb.policies.spots import Spot, spots_of
from chmarl_pb.robots.pointing import VERBS, named


class Groper:
    """Picks and places at spots; rooms on the board come first."""

    def __init__(self, rooms: tuple[str, ...]):
        """Remember the rooms."""
        self.rooms = rooms

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""
        self._picks = list[Spot]()
        self._places = list[Spot]()
        self._anchor, self._turned = "", 0
        self._queue = list[str]()
        self._holding = False

    def choose(self, view: BlindView) -> str:
        """Return the name of the next action."""
        if view.holding != self._holding:
            self._holding, self._anchor, self._queue, self._places = view.holding, "", [], []
        if not self._queue:
            spot = self._next(view.messages[int(view.holding)])
            if spot is None:
                return "stay"
            verb = named(VERBS[view.holding], spot.cell)
            self._queue = [*spot.way(self._anchor, self._turned), verb]
            self._anchor, self._turned = spot.room, spot.turned
        return self._queue.pop(0)

    def _next(self, known: tuple[str, ...]) -> Spot | None:
        """Return the next spot, and count it as tried; None if there is none in these rooms."""
        row = int(self._holding)
        left = self._places if row else self._picks
        if not _in(left, known or self.rooms):
            left += _in(spots_of(VERBS[row]), known or self.rooms)
        spot = next(iter(_in(left, known or self.rooms)), None)
        if spot is not None:
            left.remove(spot)
        return spot


def _in(spots: Sequence[Spot], rooms: Sequence[str]) -> list[Spot]:
    return [spot for spot in spots if spot.room in rooms]
