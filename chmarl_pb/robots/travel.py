"""In which posture an arm is taken along on a drive, so that it passes by what stands at the way."""

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import count
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.robots.planning import ALLOWED, MARGIN, Path

Array: TypeAlias = NDArray[np.float64]
#: How deep (n,) the arm stands in something in one posture at bases (n, 3), or in postures (n, d) at one base, with a
#: margin to be kept free.
Along: TypeAlias = Callable[[Array, Array, float], Array]
#: How the arm gets from one posture to another while the base stands somewhere: straight; True: at any cost of search.
Change: TypeAlias = Callable[[Array, Array, Array, bool], Path]

_EVERY, _TIGHT_EVERY = 8, 2  # steps of a leg between two places that are looked at, with and without the margin
_UNUSUAL = 0.2  # what a leg costs in another posture than the first
_TIGHT = 3.0  # what a leg costs that is free without its margin alone
_CHANGE = 1.0  # what each straight move of a change of posture costs
_DEEP = 1e4  # what a metre of depth costs
_JUMP = 45.0  # what it costs to begin in another posture than the first of those at the start
_SEARCHES = 6  # rounds in which changes of posture that are not free are searched for at any cost
_HOPED = 10.0  # what a change costs at most until it has been searched for
_DRAWN, _ADDED = 2048, 4  # postures that are drawn for a leg on which none of the usual ones is free; kept of them
_NEAR = 0.8  # radians, deviation of every second of them from a usual one


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
    limits: tuple[Array, Array],
) -> tuple[int, tuple[Leg, ...]]:
    """Choose a posture for every leg of a drive; the arm changes it only while the base stands.

    Args:
        legs: (n, 3) x, y and yaw of the base.
        starts: numbers of the postures at the start, that in which the arm is first.
        ends: numbers of the postures on the last leg.
        options: the postures, the usual one first.
        along: how deep a posture stands in something along a leg.
        change: how one is changed for another.
        limits: lowest and highest posture that may be drawn for a leg on which none of the options is free.

    Returns:
        Number of the posture at the start, and how each leg goes.
    """
    looked = [_every(leg, _EVERY) for leg in legs]
    if 0 in starts and 0 in ends and float(along(options[0], np.concatenate(looked), MARGIN).max()) <= 0:
        return 0, tuple(Leg(0, Path(())) for _ in legs)
    drive = _Drive(legs, starts, ends, along, change)
    start, chosen = _choose(drive, options)
    deep = [number for number, leg in enumerate(chosen[:-1]) if leg.depth > 0]
    drawn = [posture for number in deep for posture in _draw(_every(legs[number], _EVERY), options, along, limits)]
    return _choose(drive, [*options, *drawn]) if drawn else (start, chosen)


class _Drive(NamedTuple):
    """A drive, as ``choose_postures`` is told of it."""

    legs: Sequence[Array]
    starts: Sequence[int]
    ends: Sequence[int]
    along: Along
    change: Change


def _choose(drive: _Drive, options: Sequence[Array]) -> tuple[int, tuple[Leg, ...]]:
    """Choose the cheapest postures, and search at any cost for changes between them that are not free."""
    costs, depths = _leg_costs(drive.legs, options, drive.along)
    costs[-1, [option for option in range(len(options)) if option not in drive.ends]] = np.inf
    known: dict[tuple[int, int, int], Path] = {}
    searched: set[tuple[int, int, int]] = set()

    def changed(hoped: float, leg: int, one: int, other: int) -> tuple[Path, float]:
        key = leg, one, other
        if key not in known:
            known[key] = drive.change(options[one], options[other], drive.legs[leg][0], False)
        cost = _CHANGE * (len(known[key].postures) - 1) + _DEEP * known[key].depth
        return known[key], cost if key in searched else min(cost, hoped)

    for _ in range(_SEARCHES):
        start, chosen = _cheapest(costs, depths, drive.starts, partial(changed, _HOPED))
        before = (start, *(leg.option for leg in chosen))
        deep = {(n, before[n], leg.option) for n, leg in enumerate(chosen) if leg.path.depth > 0} - searched
        for n, one, other in sorted(deep):
            known[n, one, other] = drive.change(options[one], options[other], drive.legs[n][0], True)
        searched |= deep
        if not deep:
            break
    return _cheapest(costs, depths, drive.starts, partial(changed, np.inf))


def _every(leg: Array, steps: int) -> Array:
    """Return the places of a leg that are so many steps apart, and its last."""
    return leg[[*range(0, len(leg), steps), len(leg) - 1]]


def _draw(looked: Array, options: Sequence[Array], along: Along, limits: tuple[Array, Array]) -> list[Array]:
    """Draw postures that are free on a leg; return a few of them, the nearest to the options."""
    rng, usual = np.random.default_rng(0), np.stack(options)
    drawn = rng.uniform(*limits, (_DRAWN, usual.shape[1]))
    near = usual[rng.integers(len(usual), size=_DRAWN // 2)]
    drawn[1::2] = np.clip(near + rng.normal(0, _NEAR, near.shape), *limits)
    for base in looked:
        drawn = drawn[along(drawn, base, 0.0) <= 0]
        if not len(drawn):
            return []
    away = np.abs(drawn[:, None] - usual).max(axis=2).min(axis=1)
    return list(drawn[np.argsort(away, kind="stable")[:_ADDED]])


def _cheapest(
    costs: Array, depths: Array, starts: Sequence[int], changed: Callable[[int, int, int], tuple[Path, float]]
) -> tuple[int, tuple[Leg, ...]]:
    """Return the cheapest choice by A*; how a change goes, and what it costs, is asked only where it may be part."""
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
            path, price = changed(number - 1, guessed, option)
            cost += price
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


def _leg_costs(legs: Sequence[Array], options: Sequence[Array], along: Along) -> tuple[Array, Array]:
    """Return what each leg costs in each posture, and how deep it is."""
    wide, bare = (
        _deepest([_every(leg, steps) for leg in legs], options, along, margin)
        for steps, margin in ((_EVERY, MARGIN), (_TIGHT_EVERY, 0.0))
    )
    depths = np.where(bare > ALLOWED, bare, 0.0)
    costs = _TIGHT * (wide > 0) + _DEEP * depths
    costs[:, 1:] += _UNUSUAL
    return costs, depths


def _deepest(looked: Sequence[Array], options: Sequence[Array], along: Along, margin: float) -> Array:
    """Return how deep (legs, options) each posture stands in something at the worst place of each leg."""
    ends, places = np.cumsum([len(leg) for leg in looked])[:-1], np.concatenate(looked)
    return np.array([[part.max() for part in np.split(along(posture, places, margin), ends)] for posture in options]).T
