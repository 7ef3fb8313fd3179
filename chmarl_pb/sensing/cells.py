"""Where things are in a robot's picture: their pixels in the cells of a grid, and the middles of a graph's nodes."""

from collections.abc import Sequence
from typing import Any, TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, Renderer
from chmarl_pb.robots.pointing import GRID
from chmarl_pb.sensing.scene_graph import MAX_NODES
from chmarl_pb.sensing.sensors import View
from chmarl_pb.world import WorldState

Segmentation: TypeAlias = NDArray[np.integer[Any]]


#: Renderer -> robot -> the state that it has drawn last, and what that showed: an action points at what was observed.
_last: WeakKeyDictionary[Renderer, dict[str, tuple[WorldState, Segmentation]]] = WeakKeyDictionary()


def segmentation(renderer: Renderer, robot: str, state: WorldState) -> Segmentation:
    """Return what each pixel of a robot's picture of ``VISIBILITY_SIZE`` shows, by its number in ``renderer.names``.

    Args:
        renderer: draws the picture.
        robot: whose picture it is.
        state: of the renderer's world, as it is now.
    """
    kept = _last.setdefault(renderer, {})
    if robot not in kept or kept[robot][0] is not state:
        kept[robot] = state, renderer.picture(robot, VISIBILITY_SIZE).segmentation
    return kept[robot][1]


def pixels_in_cells(renderer: Renderer, robot: str, state: WorldState, numbers: Sequence[int]) -> NDArray[np.int64]:
    """Return the pixels (n, GRID, GRID) of some things in each cell of what :func:`segmentation` shows.

    Args:
        renderer: draws the picture.
        robot: whose picture it is.
        state: of the renderer's world, as it is now.
        numbers: of the things, in ``renderer.names``.
    """
    places = np.full(len(renderer.names) + 1, -1)  # the last stands for what is no thing
    places[list(numbers)] = np.arange(len(numbers))
    of_things: NDArray[np.int64] = _pixels_in_cells(segmentation(renderer, robot, state), places, len(numbers))
    return of_things


@compiled
def _pixels_in_cells(segmentation, places, count):  # type: ignore[no-untyped-def]
    """Return the pixels (count, GRID, GRID) of things; ``places`` has where each counts, -1 for not at all."""
    size, found = len(segmentation), np.zeros((count, GRID, GRID), np.int64)
    for row in range(size):
        for column in range(size):
            place = places[segmentation[row, column]]
            if place >= 0:  # a pixel is in the cell that its middle is in
                found[place, (2 * row + 1) * GRID // (2 * size), (2 * column + 1) * GRID // (2 * size)] += 1
    return found


class NodeViewSensor:
    """Where each node of the scene graph is in the robot's picture: ``node_view``.

    A row for each node: u and v, the middle of its pixels, from the left and from the top, and the share of the
    picture's pixels that are its own; all from 0 to 1, and all 0 for rooms and padding.
    """

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of the rows."""
        return {"node_view": spaces.Box(0, 1, (MAX_NODES, 3), np.float32)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the rows."""
        renderer, rows = view.renderer, np.zeros((MAX_NODES, 3), np.float32)
        if view.seen:
            found = _middles(segmentation(renderer, view.robot, view.state), len(renderer.names))
            places = {name: number for number, name in enumerate(renderer.names)}
            rows[: len(view.seen)] = found[[places[name] for name in view.seen]]  # the first nodes, in this order
        return {"node_view": rows}


@compiled
def _middles(segmentation, count):  # type: ignore[no-untyped-def]
    """Return u, v and share (count, 3) of each thing in a picture; zeros of one that it does not show."""
    size = len(segmentation)
    found = np.zeros((count, 3))
    for row in range(size):
        for column in range(size):
            number = segmentation[row, column]
            if number >= 0:
                found[number, 0] += column + 0.5
                found[number, 1] += row + 0.5
                found[number, 2] += 1
    for number in range(count):
        pixels = found[number, 2]
        if pixels > 0:
            found[number, 0] /= pixels * size
            found[number, 1] /= pixels * size
            found[number, 2] = pixels / (size * size)
    return found
