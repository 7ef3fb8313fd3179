"""In which posture an arm is taken along on a drive, so that it passes by what stands at the way."""

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import count
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.robots.planning import ALLOWED, MARGIN, Path

Array: TypeAlias = NDArray[np.float64]
#: How deep (n,) the arm stands in something in one posture, at bases (n, 3), with a margin to be kept free.
Along: TypeAlias = Callable[[Array, Array, float], Array]
#: How the arm gets from one posture to another while the base stands somewhere: straight; True: at any cost of search.
Change: TypeAlias = Callable[[Array, Array, Array, bool], Path]

_EVERY = 8  # steps of a leg between two places that are looked at
_UNUSUAL = 0.2  # what a leg costs in another posture than the first
_TIGHT = 3.0  # what a leg costs that is free without its margin alone
_CHANGE = 1.0  # what each straight move of a change of posture costs
_DEEP = 1e4  # what a metre of depth costs
_JUMP = 45.0  # what it costs to begin in another posture than the first of those at the start
_SEARCHES = 6  # rounds in which changes of posture that are not free are searched for at any cost


@dataclass(frozen=True, eq=False)
class Leg:
    """How the arm is taken along on one leg of a drive.

    Attributes:
        option: number of its posture.
        path: how the arm gets into it before.
        depth: metres that it stands in something on the leg; 0: it is free.
    """

    option: int
    path: Path
    depth: float = 0.0


def choose_postures(
    legs: Sequence[Array],
    starts: Sequence[int],
    ends: Sequence[int],
    options: Sequence[Array],
    along: Along,
    change: Change,
) -> tuple[int, tuple[Leg, ...]]:
    """Choose a posture for every leg of a drive; the arm changes it only while the base stands.

    Args:
        legs: (n, 3) x, y and yaw of the base.
        starts: numbers of the postures at the start, that in which the arm is first.
        ends: numbers of the postures on the last leg.
        options: the postures, the usual one first.
        along: how deep a posture stands in something along a leg.
        change: how one is changed for another.

    Returns:
        Number of the posture at the start, and how each leg goes.
    """
    looked = [leg[[*range(0, len(leg), _EVERY), len(leg) - 1]] for leg in legs]
    if 0 in starts and 0 in ends and float(along(options[0], np.concatenate(looked), MARGIN).max()) <= 0:
        return 0, tuple(Leg(0, Path(())) for _ in legs)
    costs, depths = _leg_costs(looked, options, along)
    costs[-1, [option for option in range(len(options)) if option not in ends]] = np.inf
    known: dict[tuple[int, int, int], Path] = {}

    def changed(leg: int, one: int, other: int) -> Path:
        if (leg, one, other) not in known:
            known[leg, one, other] = change(options[one], options[other], looked[leg][0], False)
        return known[leg, one, other]

    for _ in range(_SEARCHES):
        start, chosen = _cheapest(costs, depths, starts, changed)
        before = (start, *(leg.option for leg in chosen))
        deep = [(n, before[n], leg.option) for n, leg in enumerate(chosen) if leg.path.depth > 0]
        for n, one, other in deep:
            known[n, one, other] = change(options[one], options[other], looked[n][0], True)
        if not deep:
            break
    return _cheapest(costs, depths, starts, changed)


def _cheapest(
    costs: Array, depths: Array, starts: Sequence[int], changed: Callable[[int, int, int], Path]
) -> tuple[int, tuple[Leg, ...]]:
    """Return the cheapest choice by A*; how a change goes is asked only where it may be part of it."""
    least = np.append(np.cumsum(costs.min(axis=1)[::-1])[::-1], 0.0)  # that the legs from one on cost at least
    serial, done = count(), set()
    # Estimate of the whole, tie, cost so far, the start and the legs so far; and the posture before, where the last
    # change is a guess.
    queue: list[tuple[float, int, float, tuple[Leg, ...], int | None]] = [
        (least[0] + cost, next(serial), cost, (Leg(start, Path(())),), None)
        for start, cost in zip(starts, [0.0, *[_JUMP] * (len(starts) - 1)], strict=True)
    ]
    while True:
        _, _, cost, legs, guessed = heapq.heappop(queue)
        number, option = len(legs) - 1, legs[-1].option
        if (number, option) in done:
            continue
        if guessed is not None:
            path = changed(number - 1, guessed, option)
            cost += _CHANGE * (len(path.postures) - 1) + _DEEP * path.depth
            legs = (*legs[:-1], Leg(option, path, legs[-1].depth))
            heapq.heappush(queue, (cost + least[number], next(serial), cost, legs, None))
            continue
        if number == len(costs):
            return legs[0].option, legs[1:]
        done.add((number, option))
        for other, price in enumerate(costs[number].tolist()):
            if np.isfinite(price):
                total = cost + price + _CHANGE * (other != option)
                longer = (*legs, Leg(other, Path(()), float(depths[number, other])))
                guess = None if other == option else option
                heapq.heappush(queue, (total + least[number + 1], next(serial), total, longer, guess))


def _leg_costs(looked: Sequence[Array], options: Sequence[Array], along: Along) -> tuple[Array, Array]:
    """Return what each leg costs in each posture, and how deep it is."""
    ends = np.cumsum([len(leg) for leg in looked])[:-1]
    costs, depths = np.zeros((2, len(looked), len(options)))
    for number, posture in enumerate(options):
        wide, bare = (
            [float(part.max()) for part in np.split(along(posture, np.concatenate(looked), margin), ends)]
            for margin in (MARGIN, 0.0)
        )
        depths[:, number] = np.where(np.array(bare) > ALLOWED, bare, 0.0)
        costs[:, number] = _UNUSUAL * (number > 0) + _TIGHT * (np.array(wide) > 0) + _DEEP * depths[:, number]
    return costs, depths
