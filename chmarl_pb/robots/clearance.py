"""How deep boxes stand in upright solids: the separating axis test, many at once, without touching the simulation."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.solids import Points

Array: TypeAlias = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Boxes:
    """Boxes in any turn: n places of the same b boxes.

    Attributes:
        middles: (n, b, 3), metres.
        axes: (n, b, 3, 3), columns are the boxes' own axes.
        halves: (b, 3) half of their extents, metres.
    """

    middles: Array
    axes: Array
    halves: Array

    def only(self, some: NDArray[np.bool_]) -> "Boxes":
        """Return some of the b boxes."""
        return Boxes(self.middles[:, some], self.axes[:, some], self.halves[some])

    def at(self, x: Array, y: Array, yaw: Array) -> "Boxes":
        """Return them moved from the frame of a base to the world's, by n poses of the base (or one for all)."""
        c, s = np.cos(yaw), np.sin(yaw)
        zero, one = np.zeros_like(c), np.ones_like(c)
        turn = np.stack([c, -s, zero, s, c, zero, zero, zero, one], axis=-1).reshape(-1, 1, 3, 3)
        shift = np.stack([x, y, zero], axis=-1).reshape(-1, 1, 3)
        return Boxes((turn @ self.middles[..., None])[..., 0] + shift, turn @ self.axes, self.halves)


class Obstacles:
    """Upright prisms: convex outlines with a bottom and a top."""

    def __init__(self, prisms: Iterable[tuple[Points, float, float]]):
        """Take prisms: outline (k, 2), bottom and top, metres."""
        groups: dict[int, list[tuple[Points, float, float]]] = {}
        for prism in prisms:
            groups.setdefault(len(prism[0]), []).append(prism)
        self._groups = [_Group.of(group) for group in groups.values()]

    def near(self, low: Sequence[float], high: Sequence[float]) -> "Obstacles":
        """Return those whose bounding boxes meet a box."""
        found = Obstacles(())
        for group in self._groups:
            rows = ((group.low <= high) & (group.high >= low)).all(axis=1)
            if rows.any():
                found._groups.append(_Group(group.outlines[rows], group.low[rows], group.high[rows]))
        return found

    def joined(self, other: "Obstacles") -> "Obstacles":
        """Return these and others."""
        found = Obstacles(())
        found._groups = self._groups + other._groups
        return found

    def depth(self, boxes: Boxes, margin: float = 0.0) -> Array:
        """Return how deep (n, b) each box, grown by a margin, stands in any of them, metres; 0: nowhere."""
        halves = boxes.halves + margin
        reach = (np.abs(boxes.axes) @ halves[:, :, None])[..., 0]
        shape, deepest = reach.shape[:2], np.zeros(reach.shape[0] * reach.shape[1])
        low, high = (boxes.middles - reach).reshape(-1, 3), (boxes.middles + reach).reshape(-1, 3)
        for group in self._groups:
            some = np.flatnonzero(((group.low <= high.max(axis=0)) & (group.high >= low.min(axis=0))).all(axis=1))
            pairs = (low[:, None] < group.high[some]) & (high[:, None] > group.low[some])
            box, solid = np.nonzero(pairs.all(axis=2))
            if len(box):
                depths = group.depths(boxes, halves, box, some[solid])
                np.maximum.at(deepest, box, depths)
        return deepest.reshape(shape)


@dataclass(frozen=True, eq=False)
class _Group:
    """Prisms with equally many corners: outlines (m, k, 2), and lower and upper corners (m, 3)."""

    outlines: Array
    low: Array
    high: Array

    @classmethod
    def of(cls, prisms: list[tuple[Points, float, float]]) -> "_Group":
        outlines = np.stack([np.asarray(prism[0], dtype=float) for prism in prisms])
        low = np.column_stack([outlines.min(axis=1), [prism[1] for prism in prisms]])
        high = np.column_stack([outlines.max(axis=1), [prism[2] for prism in prisms]])
        return cls(outlines, low, high)

    def depths(self, boxes: Boxes, halves: Array, box: NDArray[np.intp], solid: NDArray[np.intp]) -> Array:
        """Return the depth (q,) of pairs of a box, numbered through all places, and a prism."""
        axes = boxes.axes.reshape(-1, 3, 3)[box]
        outlines, bottom, top = self.outlines[solid], self.low[solid, 2], self.high[solid, 2]
        directions = _directions(axes, outlines)
        extent = (np.abs(directions @ axes) @ halves[box % len(halves)][:, :, None])[..., 0]
        middle = (directions @ boxes.middles.reshape(-1, 3)[box][:, :, None])[..., 0]
        flat = directions[:, :, :2] @ np.swapaxes(outlines, 1, 2)
        up, down = directions[:, :, 2] * top[:, None], directions[:, :, 2] * bottom[:, None]
        least, most = flat.min(axis=2) + np.minimum(up, down), flat.max(axis=2) + np.maximum(up, down)
        overlap = np.minimum(middle + extent - least, most - middle + extent)
        depths: Array = np.maximum(overlap.min(axis=1), 0.0)
        return depths


def _directions(axes: Array, outlines: Array) -> Array:
    """Return unit directions (q, a, 3) that can separate boxes from prisms; a rectangle's parallel edges count once."""
    edges = np.roll(outlines, -1, axis=1) - outlines
    if edges.shape[1] == 4 and np.allclose(edges[:, :2], -edges[:, 2:], atol=1e-4):
        edges = edges[:, :2]
    edges = edges / np.linalg.norm(edges, axis=2, keepdims=True)
    count, sides = edges.shape[:2]
    along = np.zeros((count, sides + 1, 3))
    along[:, :sides, :2] = edges
    along[:, sides, 2] = 1.0
    across = np.zeros((count, sides, 3))
    across[:, :, 0], across[:, :, 1] = edges[:, :, 1], -edges[:, :, 0]
    own = np.swapaxes(axes, 1, 2)
    crossed = np.cross(own[:, :, None], along[:, None]).reshape(count, -1, 3)
    length = np.linalg.norm(crossed, axis=2, keepdims=True)
    # Parallel edges span no direction; the upright one stands in for it.
    crossed = np.where(length > 1e-3, crossed / np.maximum(length, 1e-3), [0.0, 0.0, 1.0])
    return np.concatenate([own, across, along[:, sides:], crossed], axis=1)
