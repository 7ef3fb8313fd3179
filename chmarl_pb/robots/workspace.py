"""What a chain of joints reaches around its robot: measured once, with a posture at every place as a start for more."""

from dataclasses import dataclass
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chmarl_pb.navigation.reach import Band, Reach
from chmarl_pb.robots.inverse import Column, Links, descend, place, search
from chmarl_pb.robots.rounding import rounded

Array: TypeAlias = NDArray[np.float64]

BEARING = float(np.radians(15))  # to either side; half of what a base turns by at a time

_PITCHES = np.radians((45, 70, 20, 90, 0))  # of the gripper, down is positive, the best first
_HEIGHTS = np.round(np.linspace(0.0, 2.0, 21), 6)  # metres
_STEP, _FARTHEST = 0.05, 1.6  # metres between distances that are looked at, and the last
_GAP = 0.1  # metres outside its own base within which nothing stands
_DRAWN = 4  # random postures to start from, the same for every arm of as many joints
_MOST = 40  # postures that are found for one target
_DIRECT = 0.05  # metres of weight of the gripper's direction on a short straight move


@dataclass(frozen=True, eq=False)
class Workspace:
    """Where an arm reaches, and how.

    Attributes:
        links: the arm.
        column: what it keeps off.
        mount: (2,) x and y of its first joint.
        likes: (n,) the posture that it likes most.
        drawn: (m, n) postures all over its limits, to start from.
        distances: (d,) from the base's middle, metres.
        nodes: (heights, d, n) a posture that reaches each place straight ahead; NaN: there is none, or none that
            reaches as far to the sides.
    """

    links: Links
    column: Column
    mount: Array
    likes: Array
    drawn: Array
    distances: Array
    nodes: Array

    @property
    def reach(self) -> Reach | None:
        """What it reaches, in bands of heights; None: nothing at all."""
        spans = [_longest(np.isfinite(row[:, 0])) for row in self.nodes]
        bands: list[Band] = []
        for number, (one, other) in enumerate(pairwise(spans)):
            first, last = max(one[0], other[0]), min(one[1], other[1]) - 1
            if last > first:
                near, far = self.distances[[first, last]].tolist()
                bands.append((float(_HEIGHTS[number]), float(_HEIGHTS[number + 1]), near, far))
        if not bands:
            return None
        lows, highs, nears, fars = zip(*bands, strict=True)
        middle = float(np.median([(near + far) / 2 for near, far in zip(nears, fars, strict=True)]))
        return Reach((min(nears), max(fars)), (min(lows), max(highs)), BEARING, middle, tuple(bands))

    def solve(self, target: Array, most: int = _MOST) -> Array:
        """Return configurations (k, n) that bring the grasp point to a target in the frame of the base, the best first.

        Args:
            target: (3,) metres.
            most: how many to look for.
        """
        return self._solve(target, self._near(target), most)

    def above(self, configurations: Array, height: float) -> Array:
        """Return configurations (k, n) with the grasp point as much higher, as near as can be to those given."""
        found = configurations.copy()
        for row in found:
            point, pointing = self.hand(row)
            point[2] += height
            descend(self.links, row, point, pointing, _DIRECT)
        return rounded(found, self.links.lower, self.links.upper)

    def hand(self, configuration: ArrayLike) -> tuple[Array, Array]:
        """Return the grasp point and where the gripper points in a configuration, in the frame of the base."""
        joints = np.asarray(configuration, dtype=float)
        points, pointing = np.empty((len(joints) + 1, 3)), np.empty(3)
        place(self.links, joints, np.empty((len(joints), 3)), points, pointing)
        return points[-1], pointing

    def _solve(self, target: Array, starts: Array, most: int) -> Array:
        found = np.empty((most, len(self.likes) + 1))
        yaw = np.arctan2(target[1] - self.mount[1], target[0] - self.mount[0])
        level = np.cos(_PITCHES)
        wanted = np.column_stack([level * np.cos(yaw), level * np.sin(yaw), -np.sin(_PITCHES)])
        count = search(self.links, self.column, np.asarray(target, dtype=float), wanted, starts, found)
        numbers = found[:count, -1].astype(int)
        configurations = rounded(found[:count, :-1], self.links.lower, self.links.upper)
        steep = np.append(_PITCHES, 0.0)[numbers] - _PITCHES[0]
        order = np.argsort(rounded(steep**2 + self._strain(configurations)), kind="stable")
        best: Array = configurations[order]
        return best

    def _strain(self, configurations: Array) -> Array:
        """Return how uncomfortable configurations are: far from the one it likes, or near their limits."""
        lower, upper = self.links.lower, self.links.upper
        near_limits = ((2 * configurations - lower - upper) / (upper - lower)) ** 8
        strain: Array = (near_limits + 0.1 * (configurations - self.likes) ** 2).sum(axis=1)
        return strain

    def _near(self, target: Array) -> Array:
        """Return postures to start from: those of the places next to a target, then the usual ones."""
        distance = float(np.hypot(target[0], target[1]))
        rows = np.argsort(np.abs(_HEIGHTS - target[2]), kind="stable")[:2]
        columns = np.argsort(np.abs(self.distances - distance), kind="stable")[:2]
        nodes = self.nodes[rows[:, None], columns].reshape(-1, len(self.likes))
        return np.vstack([nodes[np.isfinite(nodes[:, 0])], self.likes, self.drawn])


def measure(links: Links, column: Column, likes: ArrayLike) -> Workspace:
    """Measure what an arm reaches.

    Args:
        links: the arm.
        column: what it keeps off.
        likes: (n,) the posture that it likes most.
    """
    best, count = np.asarray(likes, dtype=float), len(links.lower)
    drawn = np.random.default_rng(0).uniform(links.lower, links.upper, (_DRAWN, count))
    distances = np.round(np.arange(column.radius + _GAP, _FARTHEST, _STEP), 6)
    nodes = np.full((len(_HEIGHTS), len(distances), count), np.nan)
    space = Workspace(links, column, links.shifts[0, :2], best, drawn, distances, nodes)
    length = float(np.linalg.norm(links.shifts[1:], axis=1).sum() + (links.upper - links.lower)[links.slides].sum())
    for row, height in enumerate(_HEIGHTS):
        for column_, distance in enumerate(distances):
            done = column_ >= 2 and np.isnan(nodes[row, column_ - 2 : column_, 0]).all()
            if done and np.isfinite(nodes[row, :, 0]).any():  # twice too far
                break
            if np.linalg.norm((distance, 0.0, height) - links.shifts[0]) <= length:
                found = _reached(space, distance, height, _starts(nodes, row, column_, space))
                if found is not None:
                    nodes[row, column_] = found
    return space


def _starts(nodes: Array, row: int, column: int, space: Workspace) -> Array:
    """Return postures to start from: those of the places measured before, next to one."""
    near = [nodes[one, other] for one, other in ((row, column - 1), (row - 1, column)) if min(one, other) >= 0]
    known = [posture for posture in near if np.isfinite(posture[0])]
    return np.stack([*known, space.likes, space.drawn[0]])


def _reached(space: Workspace, distance: float, height: float, starts: Array) -> Array | None:
    """Return a posture that reaches a place straight ahead, if it does so to either side, too."""
    ahead = space._solve(np.array([distance, 0.0, height]), starts, 1)
    if not len(ahead):
        return None
    for bearing in (-BEARING, BEARING):
        aside = np.array([distance * np.cos(bearing), distance * np.sin(bearing), height])
        if not len(space._solve(aside, np.vstack([ahead, starts]), 1)):
            return None
    posture: Array = ahead[0]
    return posture


def _longest(reached: NDArray[np.bool_]) -> tuple[int, int]:
    """Return first and one past the last of the longest run of places that are reached."""
    best, first = (0, 0), 0
    for number, one in enumerate([*reached.tolist(), False]):
        if not one:
            best = max(best, (first, number), key=lambda run: run[1] - run[0])
            first = number + 1
    return best
