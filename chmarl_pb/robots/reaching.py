"""How an arm reaches a point: of all configurations that do, one that is free and can be got to and away from."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.robots.planning import ALLOWED, Path

Array: TypeAlias = NDArray[np.float64]
#: Above which of several points (k, d) the arm gets, from which posture, and how; True: at any cost of search.
There: TypeAlias = Callable[[Array, bool], tuple[int, int, Path]]
#: How it gets away from there again.
Back: TypeAlias = Callable[[Array, bool], Path]

_BLOCKS = (1, 150)  # postures that are looked at together, the most comfortable first; then all others
_SPREAD = 8  # free postures, as different as can be, that the arm tries to get to
_ENDS = 64  # as many, that random trees look for a way to
_SEARCHED = 4  # reaches with a free way there, for which random trees look for a way back


@dataclass(frozen=True, eq=False)
class Reach:
    """How a point is reached.

    Attributes:
        target: posture with the fingertips at the point.
        above: posture above it, from which it is reached straight.
        start: number of the posture from which it is reached.
        there: the way above the point.
        back: the way from there, when the point has been reached.
    """

    target: Array
    above: Array
    start: int
    there: Path
    back: Path

    @property
    def depth(self) -> float:
        """How deep both ways are."""
        return self.there.depth + self.back.depth


def choose_reach(
    targets: Array, above: Array, depths: Callable[[Array, Array], Array], there: There, back: Back
) -> Reach:
    """Choose how to reach a point.

    Args:
        targets: (n, d) postures that reach it, the most comfortable first.
        above: (n, d) the postures above it.
        depths: how deep (k,) pairs of such postures, and the way between the two, stand in something.
        there: how the arm gets to a posture above the point.
        back: how it gets away from there.
    """
    deep = np.zeros(0)
    tried: list[tuple[float, int, Reach]] = []
    for block in np.split(np.arange(len(targets)), _BLOCKS):
        if not len(block):
            continue
        deep = np.concatenate([deep, depths(targets[block], above[block])])
        for number in _spread(targets, block[deep[block] <= ALLOWED]):
            _, start, path = there(above[[number]], False)
            if path.depth > 0:
                continue
            reach = Reach(targets[number], above[number], start, path, back(above[number], False))
            if reach.depth <= 0:
                return reach
            tried.append((reach.depth, number, reach))
    if not tried:
        some = _spread(targets, np.flatnonzero(deep <= ALLOWED), _ENDS) or [int(deep.argmin())]
        row, start, path = there(above[some], True)
        best = Reach(targets[some[row]], above[some[row]], start, path, back(above[some[row]], False))
        return best if best.back.depth <= 0 else replace(best, back=back(best.above, True))
    tried.sort(key=lambda one: one[:2])
    best = tried[0][2]
    for _, _, reach in tried[:_SEARCHED]:
        found = replace(reach, back=back(reach.above, True))
        best = min(best, found, key=lambda one: one.depth)
        if best.depth <= 0:
            break
    return best


def _spread(postures: Array, numbers: NDArray[np.intp], most: int = _SPREAD) -> list[int]:
    """Return a few of some postures' numbers: the first, then always the one that differs most from those before."""
    if not len(numbers):
        return []
    some = postures[numbers]
    chosen, apart = [0], np.abs(some - some[0]).max(axis=1)
    while len(chosen) < min(most, len(numbers)):
        chosen.append(int(apart.argmax()))
        apart = np.minimum(apart, np.abs(some - some[chosen[-1]]).max(axis=1))
    return [int(numbers[number]) for number in chosen]
