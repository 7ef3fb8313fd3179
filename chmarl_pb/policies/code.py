"""A written code for own words: which symbol says in which room X or Y has been seen.

With R rooms, symbol 1 + r says "X is in room r", symbol 1 + R + r "a Y is in room r", and 0 nothing; so 1 + 2 R symbols
are in use, and with fewer the last rooms of Y cannot be told. Each robot tells each fact that it has found out itself,
new ones first, ``REPEATS`` times; what it has heard it does not pass on.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.policies.policy import Infos, Observations, Policy
from chmarl_pb.policies.sights import places_in_view
from chmarl_pb.tasks.language import read_pairs
from chmarl_pb.tasks.symbols import SILENT

REPEATS = 2  # times that a fact is told, as symbols may be lost

Observation = dict[str, NDArray[Any]]
Fact = tuple[int, int]  # 0 for X, 1 for Y; the number of a room


class RoomCode:
    """One robot's side of the code: it hears, notes what the robot sees, and knows what is worth telling.

    Attributes:
        board: (2, rooms) int8 rooms in which X (row 0) and Y (row 1) have been seen, as far as the robot knows.
    """

    def __init__(self, rooms: tuple[str, ...], vocabulary: int, known: Catalog = BENCHMARK):
        """Remember the rooms, in the order of their numbers, and how many symbols there are."""
        self.rooms, self._vocabulary, self._catalog = rooms, vocabulary, known
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self.board: NDArray[np.int8] = np.zeros((2, len(self.rooms)), np.int8)
        self._fresh, self._repeats = list[int](), list[int]()  # symbols that are still to be said

    def listen(self, observation: Observation, info: dict[str, Any]) -> Observation:
        """Take in what is heard and seen; return the observation with the board in place of the symbols."""
        for row in observation["messages"]:
            fact = self.fact_of(int(row.argmax()) if row.any() else SILENT)
            if fact is not None:
                self.board[fact] = 1
        for fact in self._seen(observation, info):
            if not self.board[fact]:
                self.board[fact] = 1
                self._fresh.append(self.symbol_of(fact))
        return {**observation, "messages": self.board.copy()}

    def speak(self) -> int:
        """Return the symbol that is to be said now: something new, else what is to be repeated."""
        if self._fresh:
            symbol = self._fresh.pop(0)
            self._repeats += [symbol] * (REPEATS - 1)
            return symbol
        return self._repeats.pop(0) if self._repeats else SILENT

    def symbol_of(self, fact: Fact) -> int:
        """Return the symbol of a fact; that of silence if there are too few."""
        symbol = 1 + fact[0] * len(self.rooms) + fact[1]
        return symbol if symbol < self._vocabulary else SILENT

    def fact_of(self, symbol: int) -> Fact | None:
        """Return what a symbol says, or None."""
        if not 1 <= symbol <= 2 * len(self.rooms):
            return None
        row, room = divmod(symbol - 1, len(self.rooms))
        return row, room

    def _seen(self, observation: Observation, info: dict[str, Any]) -> list[Fact]:
        """Return the facts that a robot sees for itself; of what is held it tells nothing."""
        pairs = read_pairs(observation["instruction"], self._catalog)
        rows = {name: row for pair in pairs for row, name in enumerate(pair)}
        places = places_in_view(observation, info, self.rooms, self._catalog)
        return [(rows[name], self.rooms.index(room)) for name, room in places if name in rows and room in self.rooms]


class Talking:
    """A policy made for the paper's board, on a channel of own words: its robots tell each other what they see."""

    def __init__(self, policy: Policy, codes: dict[str, RoomCode]):
        """Let a policy talk.

        Args:
            policy: reads ``messages`` as (2, rooms).
            codes: robot -> its side of the code.
        """
        self.policy, self.codes = policy, codes

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)
        for code in self.codes.values():
            code.reset()

    def act(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return robot -> number of its action and symbol."""
        heard = {name: self.codes[name].listen(seen, infos[name]) for name, seen in observations.items()}
        return {name: (action, self.codes[name].speak()) for name, action in self.policy.act(heard, infos).items()}
