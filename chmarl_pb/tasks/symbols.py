"""Own words: no board; every robot says one of some symbols in every step, and the others hear it later.

Nothing has a meaning until policies give it one; the built-in search policy has :mod:`chmarl_pb.policies.code`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces

from chmarl_pb.errors import OptionError
from chmarl_pb.limits import real_number, whole_number
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.messages import Channel, Messages, Rooms
from chmarl_pb.tasks.outcome import Outcome

SILENT = 0  # the symbol that says nothing
MOST_SYMBOLS, _LONGEST = 1024, 1000


@runtime_checkable
class Talk(Channel, Protocol):
    """A channel on which the robots choose what they say: an action is then a pair, of an action and a symbol.

    Attributes:
        vocabulary: number of symbols; 0 says nothing.
    """

    vocabulary: int

    def among(self, robots: tuple[str, ...]) -> "Talk":
        """Return the channel between these robots."""

    def say(self, messages: Messages, said: Mapping[str, int], rng: np.random.Generator) -> Messages:
        """Return the messages after a step in which each robot has said a symbol; once in every step."""

    def cost(self, said: Mapping[str, int]) -> float:
        """Return what is taken off the shared reward for what has been said in a step."""


@dataclass(frozen=True)
class Symbols:
    """Every robot says one of some symbols in every step; each other robot hears it ``delay`` observations later.

    What a robot hears is (other robots, vocabulary), in the order of the robots: 1 at the number of the symbol; a row
    is all zeros where nothing is heard, as what was said is symbol 0, was lost, or is not there yet.

    >>> env = chmarl_pb.parallel_env(messages=Symbols(vocabulary=16), split="val-unseen")
    >>> _ = env.reset(seed=0)
    >>> env.action_space("humanoid")
    MultiDiscrete([10 16])
    >>> observations, *_ = env.step({"humanoid": (9, 5), "drone": (8, 0)})
    >>> int(observations["drone"]["messages"].argmax()), bool(observations["humanoid"]["messages"].any())
    (5, False)

    Attributes:
        vocabulary: number of symbols, with 0, which says nothing.
        delay: steps until a symbol is heard; 1: in the observation right after the step in which it is said.
        loss: probability that a symbol other than 0 is lost.
        flips: probability that one that is not lost is replaced by another, which is not 0.
        price: taken off the shared reward for each symbol other than 0.
        robots: between whom it is; set by :meth:`among`.
    """

    vocabulary: int = 16
    delay: int = 1
    loss: float = 0.0
    flips: float = 0.0
    price: float = 0.0
    robots: tuple[str, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            OptionError: one is out of range.
        """
        checked = {
            "vocabulary": whole_number("Symbols: vocabulary", self.vocabulary, 2, MOST_SYMBOLS),
            "delay": whole_number("Symbols: delay", self.delay, 1, _LONGEST),
            "loss": real_number("Symbols: loss", self.loss, 0, 1),
            "flips": real_number("Symbols: flips", self.flips, 0, 1),
            "price": real_number("Symbols: price", self.price, 0),
        }
        for name, value in checked.items():
            object.__setattr__(self, name, value)
        if self.flips and self.vocabulary < 3:
            raise OptionError(f"Symbols(flips={self.flips!r}): needs a vocabulary of 3, to have another symbol")

    def among(self, robots: tuple[str, ...]) -> "Symbols":
        """Return the channel between these robots.

        Raises:
            OptionError: there is but one.
        """
        if len(robots) < 2:
            raise OptionError("messages=Symbols(...) needs two robots or more: nobody hears what one says")
        return replace(self, robots=robots)

    def space(self, rooms: Rooms) -> spaces.Box:
        """Return the space of what one robot hears."""
        return spaces.Box(0, 1, (len(self.robots) - 1, self.vocabulary), np.int8)

    def begin(self, rooms: Rooms) -> Messages:
        """Return (delay, robots, vocabulary) zeros: what is on its way, first what is heard now."""
        return np.zeros((self.delay, len(self.robots), self.vocabulary), np.int8)

    def update(
        self, messages: Messages, outcome: Outcome, goal: Goal, rooms: Rooms, rng: np.random.Generator
    ) -> Messages:
        """Return the messages as they are: nobody but the robots says anything."""
        return messages

    def say(self, messages: Messages, said: Mapping[str, int], rng: np.random.Generator) -> Messages:
        """Return the messages with what each robot has said in a step, with loss and flips, and one step later."""
        new = np.zeros_like(messages[:1])
        for number, robot in enumerate(self.robots):
            symbol = self._arriving(said.get(robot, SILENT), rng)
            if symbol != SILENT:
                new[0, number, symbol] = 1
        return np.concatenate([messages[1:], new])

    def _arriving(self, symbol: int, rng: np.random.Generator) -> int:
        """Return what is heard of a symbol; silence needs no luck."""
        if symbol == SILENT or not (self.loss or self.flips):
            return symbol
        lost, flipped = rng.random(2) < (self.loss, self.flips)
        other = int(rng.integers(1, max(2, self.vocabulary - 1)))  # the same draws, whatever becomes of it
        if lost:
            return SILENT
        return other + (other >= symbol) if flipped else symbol

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return what the other robots have said, a row for each, in their order."""
        heard: Messages = np.delete(messages[0], self.robots.index(robot), axis=0)
        return heard

    def cost(self, said: Mapping[str, int]) -> float:
        """Return the price of all symbols but 0."""
        return self.price * sum(symbol != SILENT for symbol in said.values())
