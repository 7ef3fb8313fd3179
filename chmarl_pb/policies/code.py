"""A written code for own words: which symbol says in which room, and in which direction there, X or Y has been seen.

With R rooms, symbol 1 + r says "X is in room r", symbol 1 + R + r "a Y is in room r", and 0 nothing; so 1 + 2 R symbols
are in use, and with fewer the last rooms of Y cannot be told. The symbols that are left, seven of 16 with four rooms,
say in which direction from the room's middle the thing is that was named last. Each robot tells each fact that it has
found out itself, those of X first, and again with the direction once it sees that, each ``REPEATS`` times. News of X
break off what is being said of Y. To a robot that it sees beside the thing it tells in every step the direction from
there, as long as there is no other news.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.policies.expert import as_expert
from chmarl_pb.policies.policy import Infos, Observations, Policy
from chmarl_pb.policies.sights import places_in_view
from chmarl_pb.tasks.language import read_pairs
from chmarl_pb.tasks.symbols import SILENT

REPEATS = 2  # times that a fact is told, as symbols may be lost
SHARED, BEARINGS, LIVE = "shared", "bearings", "live"  # keys that are added to the observation
UNKNOWN = -1.0
_LEAST_DIRECTIONS = 3

Observation = dict[str, NDArray[Any]]
Fact = tuple[int, int]  # 0 for X, 1 for Y; the number of a room
Sentence = tuple[int, ...]  # the symbol of a fact, then that of its direction, if it is known

#: Tells the direction of a thing of a class in view from the middle of a room, radians from +x; None if unknown.
Bearing = Callable[[Observation, str, int], float | None]

#: The same from the robot that is to come to it, if that is in view; also takes 0 for X, 1 for Y.
Guiding = Callable[[Observation, str, int], float | None]


class RoomCode:
    """One robot's side of the code: it hears, notes what the robot sees, and knows what is worth telling.

    Attributes:
        board: (2, rooms) int8 rooms in which X (row 0) and Y (row 1) have been seen, as far as the robot knows.
        shared: (2, rooms) int8 the same as far as all know that nothing was lost; it has been said and heard.
        bearings: (2, rooms) the direction in which it is there, radians from 0 on, or ``UNKNOWN``; said or heard, too.
    """

    def __init__(
        self, rooms: tuple[str, ...], vocabulary: int, known: Catalog = BENCHMARK, bearing: Bearing | None = None,
        guiding: Guiding | None = None,
    ):  # fmt: skip
        """Get to know the code.

        Args:
            rooms: in the order of their numbers.
            vocabulary: how many symbols there are.
            known: the classes of things.
            bearing: tells directions; None: this robot tells none.
            guiding: tells directions from a robot in view, as long as that is to come there.
        """
        self.rooms, self._vocabulary, self._catalog = rooms, vocabulary, known
        self._bearing, self._guiding = bearing, guiding
        left = vocabulary - 1 - 2 * len(rooms)
        self._directions = left if left >= _LEAST_DIRECTIONS else 0
        self.reset()

    def reset(self) -> None:
        """Forget the last episode."""
        self.board: NDArray[np.int8] = np.zeros((2, len(self.rooms)), np.int8)
        self.shared = self.board.copy()
        self.bearings = np.full((2, len(self.rooms)), UNKNOWN)
        self._fresh, self._repeats = list[Sentence](), list[Sentence]()  # what is still to be said
        self._sentence, self._saying = Sentence(), Sentence()  # what is being said, and what is left of it
        self._again = False  # whether it was among those that are repeated
        self._said = SILENT
        self._told: Fact | None = None  # the fact that it said last
        self._pointed = set[Fact]()  # facts whose direction it has found out
        self._live: Sentence = ()  # what guides a robot in view: a fact and its direction from there
        self._named: dict[int, Fact] = {}  # robot that is heard -> the fact that it told last

    def listen(self, observation: Observation, info: dict[str, Any]) -> Observation:
        """Take in what is heard and seen; return the observation with the board in place of the symbols.

        It also gets what all robots know, and where there are symbols for them directions, and which of those have been
        heard just now.
        """
        self._told = self._take_in(self._said, self._told, self.shared)
        live = np.zeros(self.board.shape, dtype=bool)
        for number, row in enumerate(observation["messages"]):
            symbol = int(row.argmax()) if row.any() else SILENT
            named = self._take_in(symbol, self._named.get(number), self.shared, self.board)
            if named is not None:
                self._named[number] = named
                live[named] |= self.fact_of(symbol) is None and symbol != SILENT
        self._live = ()
        for name, fact in self._seen(observation, info):
            self._note(observation, name, fact)
            self._guide(observation, name, fact)
        told = {BEARINGS: self.bearings.copy(), LIVE: live} if self._directions else {}
        return {**observation, "messages": self.board.copy(), SHARED: self.shared.copy(), **told}

    def propose(self) -> int:
        """Return the symbol that is to be said now: something new, of X first, else what is to be repeated.

        Nothing counts as said before it is noted.
        """
        if self._saying and not self._is_of_x(self._sentence) and any(map(self._is_of_x, self._fresh)):
            self._break_off()
        if not self._saying and self._fresh:
            self._fresh.sort(key=lambda sentence: sentence[0])
            self._begin(self._fresh[0])
            if len(self._sentence) > 1 and self.fact_of(self._sentence[0]) == self._told:
                self._saying = self._sentence[1:]  # it has just named it
        elif not self._saying and self._live:
            return self._live[self.fact_of(self._live[0]) == self._told]
        elif not self._saying and self._repeats:
            self._begin(self._repeats[0])
        return self._saying[0] if self._saying else SILENT

    def note(self, symbol: int) -> None:
        """Go on from the symbol that was said, whatever was proposed: what was left unsaid is still to be said.

        A sentence that was broken off begins anew; one that begins with what was said in its place is gone on with.
        """
        if self._saying[:1] != (symbol,):
            if self._saying:
                self._break_off()
            instead = next((one for one in (*self._fresh, *self._repeats) if one[0] == symbol), None)
            if instead is not None:
                self._begin(instead)
        if len(self._saying) == 1 and not self._again:
            self._repeats += [self._sentence] * (REPEATS - 1)
        self._said, self._saying = symbol, self._saying[1:]

    def _begin(self, sentence: Sentence) -> None:
        """Take a sentence out of what is still to be said, to say it."""
        self._again = sentence not in self._fresh
        (self._repeats if self._again else self._fresh).remove(sentence)
        self._sentence = self._saying = sentence

    def _break_off(self) -> None:
        """Say the sentence that has been begun later, from its beginning."""
        (self._repeats if self._again else self._fresh).insert(0, self._sentence)
        self._saying = ()

    def _is_of_x(self, sentence: Sentence) -> bool:
        return sentence[0] <= len(self.rooms)

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

    def _take_in(self, symbol: int, named: Fact | None, *boards: NDArray[np.int8]) -> Fact | None:
        """Write what a robot has said on boards, or its direction; return the fact that it has named last."""
        fact = self.fact_of(symbol)
        if fact is not None:
            for board in boards:
                board[fact] = 1
            return fact
        if self._directions and symbol > 2 * len(self.rooms) and named is not None:
            self.bearings[named] = (symbol - 0.5 - 2 * len(self.rooms)) * 2 * np.pi / self._directions
        return named

    def _note(self, observation: Observation, name: str, fact: Fact) -> None:
        """Tell what is in view if it is new, or if the direction is."""
        angle = None
        if self._bearing and self._directions and fact not in self._pointed and self.bearings[fact] == UNKNOWN:
            angle = self._bearing(observation, name, fact[1])
        if self.board[fact] and angle is None:
            return
        self.board[fact] = 1
        sentence: Sentence = (self.symbol_of(fact),)
        if angle is not None:
            self._pointed.add(fact)
            sentence += (self._direction(angle),)
        if sentence[0] != SILENT:
            self._fresh.append(sentence)

    def _guide(self, observation: Observation, name: str, fact: Fact) -> None:
        """Find out what to point at for a robot in view; its sentences need not be repeated then."""
        angle = self._guiding(observation, name, fact[0]) if self._guiding and self._directions else None
        if angle is not None and not self._live:
            self._live = self.symbol_of(fact), self._direction(angle)
            self._repeats = [sentence for sentence in self._repeats if sentence[0] != self._live[0]]

    def _direction(self, angle: float) -> int:
        """Return the symbol of a direction."""
        sector = int(angle % (2 * np.pi) / (2 * np.pi) * self._directions) % self._directions
        return 1 + 2 * len(self.rooms) + sector

    def _seen(self, observation: Observation, info: dict[str, Any]) -> list[tuple[str, Fact]]:
        """Return the classes and the facts that a robot sees for itself; of what is held it tells nothing."""
        pairs = read_pairs(observation["instruction"], self._catalog)
        rows = {name: row for pair in pairs for row, name in enumerate(pair)}
        places = places_in_view(observation, info, self.rooms, self._catalog)
        return [
            (name, (rows[name], self.rooms.index(room)))
            for name, room in places if name in rows and room in self.rooms
        ]  # fmt: skip


class Talking:
    """A policy made for the paper's board, on a channel of own words: its robots tell each other what they see.

    As a policy it says what it proposes. A teacher's proposals are followed or not: it goes on from what was said.
    """

    def __init__(self, policy: Policy, codes: dict[str, RoomCode]):
        """Let a policy talk.

        Args:
            policy: reads ``messages`` as (2, rooms).
            codes: robot -> its side of the code.
        """
        self.policy, self.codes = as_expert(policy), codes

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.policy.reset(seed)
        for code in self.codes.values():
            code.reset()

    def act(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return robot -> number of its action and symbol."""
        actions = self.propose(observations, infos)
        self.note(actions)
        return actions

    def propose(self, observations: Observations, infos: Infos) -> dict[str, Any]:
        """Return robot -> number of the action and symbol that are to be chosen now; to be followed by :meth:`note`."""
        heard = {name: self.codes[name].listen(seen, infos[name]) for name, seen in observations.items()}
        return {
            name: (action, self.codes[name].propose()) for name, action in self.policy.propose(heard, infos).items()
        }

    def note(self, actions: dict[str, Any]) -> None:
        """Go on from what the robots have done and said."""
        self.policy.note({name: int(action) for name, (action, _) in actions.items()})
        for name, (_, symbol) in actions.items():
            self.codes[name].note(int(symbol))
