"""Free paths of an arm from one posture to another: straight, by a known way posture, or by a random tree.

A posture is an array: a configuration of the joints, then the yaw of what is held. Nothing here knows what is in the
way: it is asked of a function that tells how deep postures stand in something.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, permutations, product
from typing import TypeAlias

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
#: How deep (n,) postures (n, d) stand in something when a margin is to be kept free, metres; 0: nowhere.
Depths: TypeAlias = Callable[[Array, float], Array]
#: Postures at which a path may start, and at which it may end.
Ends: TypeAlias = tuple[Sequence[Array], Sequence[Array]]
#: Postures, and the number of the one that each was reached from; -1: none.
_Tree: TypeAlias = tuple[list[Array], list[int]]

MARGIN = 0.015  # metres that a path keeps free where it can
ALLOWED = 0.003  # metres of depth that count as free without the margin: things touch where they stand

_TIGHT = 0.006  # metres that it keeps free where it cannot keep more
#: rad or m of the joint that moves most, between two postures that are looked at, by the margin that is kept.
_STEPS = ((MARGIN, 0.07), (_TIGHT, 0.02), (0.0, 0.01))
_ROUNDS, _TOGETHER = 240, 16  # of the random trees; draws of one round
_NEAR = 0.4  # radians, deviation of every second draw from what a tree has
_WIDE = 1.0  # radians by which the tree goes beyond start and goal


@dataclass(frozen=True, eq=False)
class Path:
    """A way of an arm.

    Attributes:
        postures: its corners after the start; the last is the goal.
        depth: metres that it stands in something at its worst place; 0 if it is free.
        wide: whether it keeps ``MARGIN`` free; if not, there is no room for the motors to lag.
    """

    postures: tuple[Array, ...]
    depth: float = 0.0
    wide: bool = True


def find_path(
    depths: Depths,
    start: Array,
    goals: Sequence[Array],
    ways: Sequence[Array],
    limits: tuple[Array, Array] | None,
) -> Path:
    """Return a free path to one of several postures, or the least bad one that is known.

    Args:
        depths: how deep postures stand in something.
        start: where the arm is.
        goals: where it shall be, the best first.
        ways: postures by which it may go.
        limits: lowest and highest posture that a random tree may draw; None: no tree is grown.
    """
    # No deeper than where it has to begin or end.
    ends = depths(np.stack([start, *goals]), 0.0)
    allowed = max(ALLOWED, float(ends[0]), float(ends[1:].min()))
    others = [way for way in ways if not any(np.array_equal(way, goal) for goal in goals)]
    best = Path((goals[0],), np.inf, False)
    for margins, most in (((MARGIN, _TIGHT), 0.0), ((0.0,), allowed)):
        for some, margin in product(((), others) if others else ((),), margins):
            best = _by_ways(depths, start, goals, some, margin, most)
            if best.depth <= most:
                return Path(best.postures, _counted(best.depth), margin == MARGIN)
    found = None if limits is None else search(depths, ([start], goals), ways, limits)
    return best if found is None else found[2]


def search(
    depths: Depths, ends: Ends, ways: Sequence[Array], limits: tuple[Array, Array], seed: int = 0
) -> tuple[int, int, Path] | None:
    """Look for a path by random trees that grow towards each other.

    Args:
        depths: how deep postures stand in something.
        ends: where the arm may start, and where it may get to.
        ways: postures towards which the trees grow first.
        limits: lowest and highest posture that they may draw.
        seed: of what they draw.

    Returns:
        Numbers of its start and its goal, and the path; None if none was found.
    """
    for margin in (_TIGHT, 0.0):
        # No deeper than where it has to begin or end.
        allowed = max(0.0 if margin else ALLOWED, *(float(depths(np.stack(some), margin).min()) for some in ends))
        if margin and allowed > 0:
            continue
        tree = _grow(depths, margin, ends, ways, limits, allowed, np.random.default_rng(seed))
        if tree is not None:
            first, last = (
                next(number for number, one in enumerate(some) if one is tree[place])
                for some, place in zip(ends, (0, -1), strict=True)
            )
            return first, last, Path(_shortened(depths, tree, margin, allowed), _counted(allowed), False)
    return None


def _by_ways(
    depths: Depths, start: Array, goals: Sequence[Array], ways: Sequence[Array], margin: float, free: float
) -> Path:
    """Return the least deep path of straight moves by way postures, of equally deep ones that of fewest moves."""
    nodes = [start, *goals, *ways]
    pairs = list(combinations(range(len(nodes)), 2))
    deep = np.zeros((len(nodes), len(nodes)))
    for (one, other), depth in zip(
        pairs, _deepest(depths, [(nodes[one], nodes[other]) for one, other in pairs], margin), strict=True
    ):
        deep[one, other] = deep[other, one] = depth if depth > free else 0.0
    best: list[tuple[float, tuple[int, ...]]] = [(float(deep[0, node]), (node,)) for node in range(len(nodes))]
    for _ in nodes[2:]:
        for via, node in permutations(range(1, len(nodes)), 2):
            depth = max(best[via][0], float(deep[via, node]))
            if (depth, len(best[via][1]) + 1) < (best[node][0], len(best[node][1])):
                best[node] = depth, (*best[via][1], node)
    depth, corners = min(best[1 : len(goals) + 1], key=lambda known: (known[0], len(known[1])))
    return Path(tuple(nodes[corner] for corner in corners), depth, False)


def find_start(depths: Depths, starts: Sequence[Array], goal: Array) -> tuple[int, Path]:
    """Return from which of several postures a goal is best reached straight, the first if it is free, and the path."""
    for margin in (MARGIN, _TIGHT, 0.0):
        deepest = _deepest(depths, [(start, goal) for start in starts], margin)
        free = [number for number, depth in enumerate(deepest) if depth <= (ALLOWED if margin == 0 else 0.0)]
        if free:
            return free[0], Path((goal,), wide=margin == MARGIN)
    return int(np.argmin(deepest)), Path((goal,), min(deepest), False)


def line(start: Array, goal: Array, margin: float = 0.0) -> Array:
    """Return postures (n, d) from a start, which is not among them, straight to a goal, which is."""
    step = next(step for least, step in _STEPS if margin >= least)
    count = max(1, int(np.ceil(np.abs(goal - start).max() / step)))
    return start + np.linspace(0, 1, count + 1)[1:, None] * (goal - start)


def _counted(depth: float) -> float:
    """Return a depth, or 0 if it is no more than things have that touch."""
    return depth if depth > ALLOWED else 0.0


def _deepest(depths: Depths, edges: Sequence[tuple[Array, Array]], margin: float) -> list[float]:
    lines = [line(*edge, margin) for edge in edges]
    found = depths(np.concatenate(lines), margin)
    ends = np.cumsum([len(one) for one in lines])[:-1]
    return [float(part.max()) for part in np.split(found, ends)]


def _grow(
    depths: Depths,
    margin: float,
    ends: Ends,
    ways: Sequence[Array],
    limits: tuple[Array, Array],
    allowed: float,
    rng: Generator,
) -> list[Array] | None:
    """Grow two random trees towards each other; return the postures from a start to a goal, or None."""
    both = np.stack([*ends[0], *ends[1]])
    low, high = np.maximum(limits[0], both.min(axis=0) - _WIDE), np.minimum(limits[1], both.max(axis=0) + _WIDE)
    trees: list[_Tree] = [([*some], [-1] * len(some)) for some in ends]
    for turn in range(_ROUNDS):
        one, other = trees[turn % 2], trees[1 - turn % 2]
        drawn = rng.uniform(low, high, (_TOGETHER, len(low)))
        near = rng.integers(len(one[0]), size=_TOGETHER // 2)  # of the way out of a narrow place the first part is hard
        drawn[1::2] = np.clip([one[0][k] + rng.normal(0, _NEAR, len(low)) for k in near], low, high)
        aims = [*ways, *drawn] if turn < 2 else [*drawn]
        grown = [number for number in _extend(depths, margin, one, aims, allowed) if number is not None]
        met = _extend(depths, margin, other, [one[0][number] for number in grown], allowed)
        for here, there in zip(grown, met, strict=True):
            if there is not None and np.array_equal(other[0][there], one[0][here]):
                both_ways = [_back(one, here), _back(other, there)]
                first, second = both_ways if turn % 2 == 0 else both_ways[::-1]
                return [*first[::-1], *second[1:]]
    return None


def _extend(depths: Depths, margin: float, tree: _Tree, aims: Sequence[Array], allowed: float) -> list[int | None]:
    """Go straight from the nearest posture of a tree towards each of some aims while that is free.

    Returns:
        The number of the last posture on the way to each aim; None if there is none.
    """
    if not aims:
        return []
    postures, parents = tree
    known = np.stack(postures)
    nearest = [int(np.abs(known - aim).max(axis=1).argmin()) for aim in aims]
    lines = [line(known[start], aim, margin) for start, aim in zip(nearest, aims, strict=True)]
    free = np.split(depths(np.concatenate(lines), margin) <= allowed, np.cumsum([len(steps) for steps in lines])[:-1])
    last = list[int | None]()
    for start, steps, good in zip(nearest, lines, free, strict=True):
        count = len(steps) if good.all() else int(good.argmin())
        parent = start
        for step in sorted({count // 2, count} - {0}):
            postures.append(steps[step - 1])
            parents.append(parent)
            parent = len(postures) - 1
        last.append(parent if count else None)
    return last


def _back(tree: _Tree, number: int) -> list[Array]:
    """Return the postures from one of a tree back to its root."""
    postures, parents = tree
    found = [postures[number]]
    while parents[number] >= 0:
        number = parents[number]
        found.append(postures[number])
    return found


def _shortened(depths: Depths, postures: list[Array], margin: float, allowed: float) -> tuple[Array, ...]:
    """Leave out what a straight move passes by; the first posture is the start and is not returned."""
    kept, here = [], 0
    while here < len(postures) - 1:
        rest = range(len(postures) - 1, here, -1)
        deepest = _deepest(depths, [(postures[here], postures[there]) for there in rest], margin)
        here = next((there for there, depth in zip(rest, deepest, strict=True) if depth <= allowed), here + 1)
        kept.append(postures[here])
    return tuple(kept)


def as_posture(configuration: ArrayLike, turn: float = 0.0) -> Array:
    """Return a configuration and the yaw of what is held as one array."""
    return np.append(np.asarray(configuration, dtype=float), turn)
