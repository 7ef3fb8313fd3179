"""Messages: two binary vectors, shared by both robots, of the rooms where X and Y have been seen."""

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.outcome import Outcome

Messages = NDArray[np.int8]


def no_messages(rooms: tuple[str, ...]) -> Messages:
    """Return the messages (2, rooms) of an episode's start: nothing is known."""
    return np.zeros((2, len(rooms)), dtype=np.int8)


def update(messages: Messages, outcome: Outcome, goal: Goal, rooms: tuple[str, ...]) -> Messages:
    """Return the messages with what either robot has identified since; bits are never cleared.

    Args:
        messages: (2, rooms) what was known: row 0 for X, row 1 for Y.
        outcome: who sees what now.
        goal: X and Y.
        rooms: the rooms that have a bit, in order.
    """
    now = messages.copy()
    seen: set[str] = set().union(*outcome.seen.values())
    for name in seen.intersection(goal.receptacles):
        _set(now[1], catalog.room_of(name), rooms)
    if goal.item in seen:
        _set(now[0], outcome.item_room, rooms)
    return now


def _set(row: NDArray[np.int8], room: str, rooms: tuple[str, ...]) -> None:
    if room in rooms:
        row[rooms.index(room)] = 1
