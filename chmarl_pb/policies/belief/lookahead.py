"""Looking ahead: the next views of a robot that drives, by what they bring before the others would bring it."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.policies.belief.knowledge import Station
from chmarl_pb.policies.belief.looks import GOTO, Look
from chmarl_pb.policies.belief.statistics import TURNS, Bits

_DEPTH, _WIDTH = 9, 8  # steps that are looked ahead, and ways that are gone further
_SIDES = (("turn_left", 1), ("turn_right", -1))
_LATEST = 60


class Prospects(NamedTuple):
    """What may come into view: sets of spots that the same views show.

    Attributes:
        room: (n,) number of the room.
        mask: (n,) bit for each turn at the room's anchor that shows the thing.
        worth: (n,) what each step is worth by which it is seen sooner.
        due: (n,) step, whole, after which it is seen without this robot's looking for it.
    """

    room: Bits
    mask: Bits
    worth: NDArray[np.float64]
    due: Bits


def prospects(room: Bits, mask: Bits, worth: NDArray[np.float64], due: NDArray[np.float64]) -> Prospects:
    """Return the prospects of spots, like ones as one; those that no view shows are left out."""
    shown = mask > 0
    step = np.minimum(due[shown], _LATEST).astype(np.int64)
    sets, which = np.unique(((room[shown] << TURNS) + mask[shown] << TURNS) + step, return_inverse=True)
    worths = np.bincount(which, worth[shown], minlength=len(sets)).astype(np.float64)
    ones = (1 << TURNS) - 1
    return Prospects(sets >> 2 * TURNS, sets >> TURNS & ones, worths, sets & ones)


def joined(parts: Sequence[Prospects]) -> Prospects:
    """Return the prospects of several things together."""
    return Prospects(*(np.concatenate(columns) for columns in zip(*parts, strict=True)))


def best_look(rooms: int, here: Station | None, ahead: Prospects) -> Look:
    """Return the first action of the best way, found by a beam search, and what the way saves.

    The action is that of a turn, or ``GOTO`` with the number of a room.

    Args:
        rooms: how many rooms there are.
        here: where the robot stands, None if not at an anchor.
        ahead: what may come into view.
    """
    numbers = np.arange(rooms * TURNS)[:, None]
    shown = ((ahead.room == numbers // TURNS) & (ahead.mask >> numbers % TURNS & 1 == 1)).astype(np.float32)
    left, due = ahead.worth[None].astype(np.float32), ahead.due.astype(np.float32)
    beam = [(0.0, -1 if here is None else here.room * TURNS + here.turn, "")]  # what it saves, the view, how it begins
    for step in range(1, _DEPTH + 1):
        gains = ((left * np.maximum(due - step, 0)) @ shown.T).tolist()
        ways: dict[tuple[float, int], tuple[int, str]] = {}
        for number, (value, place, first) in enumerate(beam):
            for view, action in _steps(rooms, place):
                ways.setdefault((-round(value + gains[number][view], 6), view), (number, first or action))
        chosen = sorted(ways.items(), key=lambda way: way[0])[:_WIDTH]
        beam = [(-loss, view, first) for (loss, view), (_, first) in chosen]
        left = np.stack([left[number] * (1 - shown[view]) for (_, view), (number, _) in chosen])
    return Look(beam[0][2], beam[0][0])


def _steps(rooms: int, place: int) -> list[tuple[int, str]]:
    """Return the views after a step from a view, and the step."""
    steps = [(number * TURNS, f"{GOTO}{number}") for number in range(rooms)]
    if place >= 0:
        room, turn = divmod(place, TURNS)
        steps += [(room * TURNS + (turn + side) % TURNS, action) for action, side in _SIDES]
    return steps
