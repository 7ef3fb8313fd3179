"""Which generated homes the splits play in: those with the benchmark's four kinds of rooms, one of each.

Their seeds lie in ranges of their own; those below the first range are in no split.
"""

from collections.abc import Iterator
from itertools import islice

import numpy as np

from chmarl_pb.catalog import ROOM_KINDS, room_kind
from chmarl_pb.homes.generate.draws import Draws
from chmarl_pb.homes.generate.names import MOST_SEED, home_name
from chmarl_pb.homes.generate.rooms import rooms_of

#: Split -> seeds that its homes may have; of a fixed split the first that fit.
SEEDS = {
    "generated-val": range(1_000_000, 2_000_000),
    "generated-test": range(2_000_000, 3_000_000),
    "generated": range(10**9, MOST_SEED),
}

#: Episodes that are played in a home of the endless split before the next: making and entering one takes up to a
#: second, a hundred episodes take several.
EPISODES_IN_A_HOME = 100

_STREAM = 7  # of a home's number, that its seed is drawn from
_NUMBERS = 2**31


def fits(seed: int) -> bool:
    """Tell whether the home of a seed has a kitchen, a bedroom, a bathroom and a living room, one each.

    So have the benchmark's, and with the rooms that robots can be sent to, observations and actions are the same.
    """
    return sorted(room for room in rooms_of(seed) if room_kind(room) in ROOM_KINDS) == sorted(ROOM_KINDS)


def first_homes(split: str, count: int) -> tuple[str, ...]:
    """Return the names of the homes of a fixed split."""
    return tuple(map(home_name, islice(filter(fits, SEEDS[split]), count)))


def numbered_homes(number: int) -> Iterator[str]:
    """Yield the endless split's home of a number, then those that take its place should it not do."""
    draws, seeds = Draws(number, _STREAM), SEEDS["generated"]
    while True:
        seed = seeds[draws.below(len(seeds))]
        if fits(seed):
            yield home_name(seed)


class HomeStream:
    """The homes that an environment plays in, one after the other: each for ``EPISODES_IN_A_HOME`` episodes.

    Seeds of a hundred in a row, from one that ends with 00 on, begin in the same home.
    """

    def __init__(self) -> None:
        """Begin with no home: the next is a random one."""
        self._homes, self._home, self._left = numbered_homes(0), "", 0

    def begin(self, seed: int) -> None:
        """Go to the home of a seed."""
        self._enter(seed // EPISODES_IN_A_HOME)

    def next(self, rng: np.random.Generator) -> str:
        """Return the home of the next episode."""
        if not self._left:
            self._enter(int(rng.integers(_NUMBERS)))
        self._left -= 1
        return self._home

    def skip(self) -> str:
        """Return the home that takes the place of the present one, which has no task that can be solved."""
        self._home = next(self._homes)
        return self._home

    def _enter(self, number: int) -> None:
        self._homes = numbered_homes(number)
        self._home, self._left = next(self._homes), EPISODES_IN_A_HOME
