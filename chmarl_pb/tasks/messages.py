"""Messages: what the robots tell each other, and the channel that carries it."""

from typing import Any, Protocol, runtime_checkable

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.outcome import Outcome

Messages = NDArray[Any]
Rooms = tuple[str, ...]


@runtime_checkable
class Channel(Protocol):
    """Carries messages, e.g. ``messages=MyChannel()``: what has been said in an episode, and what a robot hears of it.

    What has been said is one array, which each step replaces; the channel itself keeps nothing of an episode. It must
    be picklable, as environments are copied with it. ``rng`` are the environment's random numbers.

    >>> class Broken(Board):
    ...     def hear(self, messages, robot, rng):
    ...         return np.zeros_like(messages) if robot == "humanoid" else messages.copy()
    >>> env = chmarl_pb.parallel_env(messages=Broken(), split="val-unseen")
    >>> observations, infos = env.reset(seed=0)
    >>> int(observations["humanoid"]["messages"].sum())
    0
    """

    def space(self, rooms: Rooms) -> spaces.Box:
        """Return the space of what one robot hears, the observation ``messages``; ``rooms`` can have a bit each."""

    def begin(self, rooms: Rooms) -> Messages:
        """Return what has been said before an episode; ``state()`` holds it, too, so its shape is fixed."""

    def update(
        self, messages: Messages, outcome: Outcome, goal: Goal, rooms: Rooms, rng: np.random.Generator
    ) -> Messages:
        """Return the messages with what the robots have seen in an outcome; once for each goal."""

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return what a robot hears of it, an array of its own."""


class Board:
    """The paper's channel: two binary vectors, shared by all robots, of the rooms where X and Y have been seen."""

    def space(self, rooms: Rooms) -> spaces.Box:
        """Return the space of two vectors: row 0 for X, row 1 for Y."""
        return spaces.Box(0, 1, (2, len(rooms)), np.int8)

    def begin(self, rooms: Rooms) -> Messages:
        """Return zeros: nothing is known."""
        return np.zeros((2, len(rooms)), dtype=np.int8)

    def update(
        self, messages: Messages, outcome: Outcome, goal: Goal, rooms: Rooms, rng: np.random.Generator
    ) -> Messages:
        """Return the board with what any robot has identified since; bits are never cleared."""
        now = messages.copy()
        for seen in outcome.seen.values():
            if goal.item in seen:
                _set(now[0], outcome.item_room, rooms)
            for name in goal.receptacles:
                if name in seen:
                    _set(now[1], catalog.room_of(name), rooms)
        return now

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return the whole board."""
        return messages.copy()


class Silence(Board):
    """The same board, but nobody reads it: it is heard as zeros."""

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        """Return zeros."""
        return np.zeros_like(messages)


def is_board(space: spaces.Space[Any], rooms: Rooms) -> bool:
    """Return whether a space is that of the message board: a bit for X and one for Y in each room.

    One of the same shape whose values are others, as ages or probabilities, is none.
    """
    if space.shape != (2, len(rooms)):
        return False
    if isinstance(space, spaces.MultiDiscrete):
        return not np.any(space.start) and bool(np.all(space.nvec == 2))
    if isinstance(space, spaces.Box):
        whole = space.dtype is not None and space.dtype.kind in "biu"
        return whole and not np.any(space.low) and bool(np.all(space.high == 1))
    return isinstance(space, spaces.MultiBinary)


def _set(row: NDArray[np.int8], room: str, rooms: Rooms) -> None:
    if room in rooms:
        row[rooms.index(room)] = 1
