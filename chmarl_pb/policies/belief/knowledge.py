"""What a robot knows of a home: where it has looked in vain, what it has seen where, and what follows for X and Y."""

from collections import defaultdict
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.policies.belief.statistics import FLIGHTS, TURNS, Bits, Spots, Statistics, class_bits
from chmarl_pb.policies.sights import OTHER

#: What is left of a spot's probability after one view that should have shown the thing: no home is like another.
MISSED = 0.3
#: The same after a view from above.
OVERLOOKED = 0.15
_BARE = 0.6  # ... after a view of a receptacle of the spot's class in that room without the thing
# Log odds against a layout for each class that a view shows and it does not, or the reverse, and that it does not hold.
_MISFIT, _ABSENT = 0.4, 0.55
_TRAINED = 0.5  # probability, before anything is seen, that this is one of the homes of training
_EXACT = 2.5  # how much more their misfits count: they have the same views
_ELSEWHERE = 0.2  # ... of a spot that the view which found the thing from above does not show
_AWRY = 0.3  # ... of a spot that is not in the direction in which a robot that flies found the thing
_ASTRAY = 0.1  # ... of a spot that is not in the direction that was told
_COUNT = np.array([bin(number).count("1") for number in range(1 << 16)], dtype=np.float64)


class Station(NamedTuple):
    """Where a robot that drives stands: at a room's anchor, so many turns to the left after it came there."""

    room: int
    turn: int


class Find(NamedTuple):
    """The view from above that showed a thing first: a room and one of ``FLIGHTS``."""

    room: int
    flight: int


class Belief(NamedTuple):
    """Where a thing may be, and how probable each spot is; the probabilities sum to one."""

    spots: Spots
    chance: NDArray[np.float64]

    def in_rooms(self, count: int) -> NDArray[np.float64]:
        """Return (count,) how probable each room is."""
        return np.bincount(self.spots.room, self.chance, minlength=count).astype(np.float64)


class Evidence(NamedTuple):
    """What the others' views tell of one thing.

    Attributes:
        flown: (rooms,) bit for each of ``FLIGHTS`` from which a robot looked in vain.
        heard: (rooms,) whether messages name the room.
        find: the view that found it, if known.
        doubt: what is left of the probability of the rooms that messages do not name.
        bearings: (rooms,) the direction from each room's middle in which it was told to be, radians, or negative.
    """

    flown: Bits
    heard: NDArray[np.bool_]
    find: Find | None = None
    doubt: float = 0.0
    bearings: NDArray[np.float64] | None = None


class Knowledge:
    """What one robot has seen in an episode.

    Attributes:
        statistics: what it expects of homes.
        viewed: (rooms,) bit for each turn at the anchor after which it has looked.
        sighted: class -> (rooms,) bit for each of these views that showed such a thing at last, wherever that stands.
    """

    def __init__(self, statistics: Statistics):
        """Know nothing but statistics."""
        self.statistics = statistics
        rooms = len(statistics.rooms)
        self.viewed: Bits = np.zeros(rooms, dtype=np.int64)
        self.sighted: dict[str, Bits] = defaultdict(lambda: np.zeros(rooms, dtype=np.int64))
        self._misfit = np.zeros(len(statistics.layouts))
        self._found = np.zeros(rooms, dtype=np.int64)  # classes of receptacles that it has seen in each room
        self._bare = np.zeros((rooms, 16))  # views that have shown a receptacle of each class
        self._headings: dict[int, int] = {}

    def view(self, seen: Collection[tuple[str, str]], station: Station | None, heading: int = 0) -> None:
        """Note what is in view.

        Args:
            seen: class and room of each thing; "" for the room of an object.
            station: where the robot stands, if it is at an anchor.
            heading: of the robot, in steps of 30 degrees from +x.
        """
        for number, room in enumerate(self.statistics.rooms):
            bits = class_bits([name.removeprefix(OTHER) for name, where in seen if where == room])
            self._compare(number, bits, station)
        if station is not None:
            self._headings[station.room] = heading - station.turn
            self.viewed[station.room] |= 1 << station.turn
            for name in self.sighted:
                self.sighted[name][station.room] &= ~(1 << station.turn)
            for name, _ in seen:
                self.sighted[name][station.room] |= 1 << station.turn

    def belief(self, spots: Spots, evidence: Evidence, on: bool) -> Belief:
        """Return where a thing is that has not been seen.

        Args:
            spots: where it may be.
            evidence: what others have told of it.
            on: whether it stands on the receptacles of the spots, else it is one of them.
        """
        chance = spots.weight * self._fit()[spots.layout] * MISSED ** _COUNT[spots.near & self.viewed[spots.room]]
        if on:
            chance *= _BARE ** np.minimum(self._bare[spots.room, spots.support], 3)
        chance[spots.above & evidence.flown[spots.room] != 0] *= OVERLOOKED
        if evidence.find is not None:
            chance *= self._likelihood(spots, evidence.find)
        bearings = np.empty(0) if evidence.bearings is None else evidence.bearings
        for room in np.flatnonzero(bearings >= 0).tolist():
            turn = self.turn_to(room, float(bearings[room]))
            if turn is not None:
                chance[(spots.room == room) & (spots.near >> turn & 1 == 0)] *= _ASTRAY
        if evidence.heard.any():
            chance[~evidence.heard[spots.room]] *= evidence.doubt
        if not chance.any():  # a message names a room in which the statistics know no such thing
            chance = np.where(evidence.heard[spots.room], 1.0, 1e-9)
        return Belief(spots, chance / chance.sum())

    def _compare(self, room: int, bits: int, station: Station | None) -> None:
        """Compare the classes of receptacles in view in a room with its layouts."""
        statistics, of = self.statistics, self.statistics.layouts == room
        new = bits & ~int(self._found[room])
        if new:
            self._found[room] |= new
            self._misfit[of] += _ABSENT * _COUNT[new & ~statistics.furniture[of]]
        if station is not None and station.room == room and not self.viewed[room] >> station.turn & 1:
            self._misfit[of] += _MISFIT * _COUNT[bits ^ statistics.shown[of, station.turn]]
            self._bare[room] += [bits >> number & 1 for number in range(16)]

    def _fit(self) -> NDArray[np.float64]:
        """Return how probable each layout is, 1 on average in each room.

        This is one of the homes of training, of which all rooms tell, or another, of which each room tells by itself.
        """
        layouts, homes = self.statistics.layouts, self.statistics.homes
        rooms, count = len(self.statistics.rooms), int(homes.max()) + 1
        fit, keys = np.exp(-self._misfit), homes * rooms + layouts
        sums, counts = (np.bincount(keys, weights, count * rooms) for weights in (fit, None))
        odds = np.log(np.maximum(sums, 1e-300) / np.maximum(counts, 1)).reshape(count, rooms).sum(axis=1)
        # Where no home of training is known, there are no such odds.
        odds[1:] = odds[1:] * _EXACT + np.log(_TRAINED / (1 - _TRAINED) / max(count - 1, 1))
        chances = np.exp(odds - odds.max())[homes] * fit / sums[keys]
        fitting: NDArray[np.float64] = chances * (np.bincount(layouts) / np.bincount(layouts, chances))[layouts]
        return fitting

    def _likelihood(self, spots: Spots, find: Find) -> NDArray[np.float64]:
        """Return (n,) how probable it is that a thing at each spot is first found by a view from above."""
        there = spots.room == find.room
        likelihood = np.where(there & (spots.above >> find.flight & 1 == 0), _ELSEWHERE, 1.0)
        ahead = self._bearing(find)
        if ahead is not None:
            likelihood[there & (spots.near >> ahead & 1 == 0)] *= _AWRY
        return likelihood

    def _bearing(self, find: Find) -> int | None:
        """Return the turn that looks where a robot flew to find a thing; None if that is not known or no direction."""
        right, forward = FLIGHTS[find.flight]
        if find.room not in self._headings or not (right or forward):
            return None
        return (round(float(np.arctan2(forward, right)) * TURNS / (2 * np.pi)) - self._headings[find.room]) % TURNS

    def turn_to(self, room: int, angle: float) -> int | None:
        """Return the turn at a room's anchor that looks in a direction; None where it has not stood there."""
        if room not in self._headings:
            return None
        return (round(angle * TURNS / (2 * np.pi)) - self._headings[room]) % TURNS

    def ahead(self, find: Find | None) -> int | None:
        """Return the turn that looks where a robot flew to find a thing, if that is known."""
        return None if find is None else self._bearing(find)
