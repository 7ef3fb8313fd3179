"""Plans of looking around in a room: after how many steps which turn comes into view."""

from collections.abc import Iterator
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.policies.belief.statistics import TURNS, Bits

#: Steps that a plan counts for what it never shows.
NEVER = 40
GOTO = "goto"
_SIDES = {1: "turn_left", -1: "turn_right"}
_MASKS = np.arange(1 << TURNS)


class Plans(NamedTuple):
    """Plans from one station.

    Attributes:
        first: the first action of each; ``GOTO`` is that of the room.
        steps: (plans, 2 ** TURNS) steps after which a thing is seen that is in view at the turns of a mask.
    """

    first: tuple[str, ...]
    steps: NDArray[np.uint8]


class Look(NamedTuple):
    """The first action of a plan, and what the plan is worth: expected steps, or steps that it saves."""

    action: str
    value: float


@cache
def plans(turn: int | None) -> Plans:
    """Return the plans of a robot that stands at a room's anchor after a turn, or elsewhere if None."""
    ways = list(_ways(turn))
    return Plans(
        tuple(first for first, _ in ways), np.stack([_steps(views) for _, views in ways])
    )  # fmt: skip


def _ways(turn: int | None) -> Iterator[tuple[str, list[int]]]:
    """Yield the first action, and the turns in view after each step."""
    for side in _SIDES:
        for most in range(1, TURNS):
            there = [side * number for number in range(most + 1)]
            back = [-side * number for number in range(TURNS - most)]  # from the anchor's heading, by Goto
            yield GOTO, there + back
            if turn is not None:
                there = [turn + side * number for number in range(1, most + 1)]
                yield _SIDES[side], there + [-side * number for number in range(TURNS)]
                yield _SIDES[side], there + [turn + side * (most - number) for number in range(1, TURNS)]


def _steps(turns: list[int]) -> NDArray[np.uint8]:
    """Return (2 ** TURNS,) after how many steps a view is among those of a mask."""
    steps = np.full(len(_MASKS), NEVER, dtype=np.uint8)
    for number in range(len(turns) - 1, -1, -1):
        steps[_MASKS >> turns[number] % TURNS & 1 == 1] = number + 1
    return steps


def soonest(options: Plans, masks: Bits, chance: NDArray[np.float64]) -> Look:
    """Return the plan with the fewest expected steps until a thing is seen.

    Args:
        options: the plans.
        masks: (n,) turns at which the thing is in view if it is at each spot.
        chance: (n,) how probable each spot is.
    """
    steps = options.steps[:, masks] @ chance
    best = int(steps.argmin())
    return Look(options.first[best], float(steps[best]))
