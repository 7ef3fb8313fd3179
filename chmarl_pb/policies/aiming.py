"""Where to point: the cells of the picture that name what a robot sees, as far as its observation tells."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.sights import OTHER, classes_of_nodes
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE, VISIBLE_PIXELS
from chmarl_pb.robots.pointing import CELLS, GRID, MIDDLE, VERBS, Cell, named

Observation = dict[str, np.ndarray]
Views = NDArray[np.float64]  # (n, 3) u, v and share of pixels of some nodes, as in ``node_view``

SURE = 0.5  # part of the pixels in a cell from which on it is pointed at
_LEAST = VISIBLE_PIXELS / VISIBILITY_SIZE**2  # share of a picture from which on things are visible
_TURN, _PITCH, _FIELD = np.pi / 6, np.pi / 9, 1.0  # of the humanoid: a turn, its camera's pitch and half width at 1 m


class Aim(NamedTuple):
    """A cell to point at, and the part that a thing has there of the pixels of things that are taken alike."""

    cell: Cell
    part: float


class Nodes(NamedTuple):
    """The objects, or the receptacles, that a robot sees: their classes, and where they are in its picture."""

    names: tuple[str, ...]
    views: Views


def nodes_of(observation: Observation, kinds: Collection[str], known: Catalog) -> Nodes:
    """Return what is in view of some classes, but for what is held; nothing where nodes have no place."""
    if "node_view" not in observation:
        return Nodes((), np.zeros((0, 3)))
    names, views = classes_of_nodes(observation, known), observation["node_view"].astype(float)
    there = (observation["node_state"] != known.state_ids["held"]) & (views[:, 2] > 0)
    numbers = [number for number in np.flatnonzero(there).tolist() if names[number].removeprefix(OTHER) in kinds]
    chosen = sorted(numbers, key=lambda number: -views[number, 2])
    return Nodes(tuple(names[number] for number in chosen), views[chosen])


def aims_at(nodes: Nodes, wanted: Collection[str]) -> list[Aim]:
    """Return the cells at which Pick, or Place, may take one of the wanted classes, the surest first.

    A node tells the middle of its pixels and how many they are, not which: it is taken for a square.
    """
    mine = np.array([name in wanted for name in nodes.names], dtype=bool)
    if not mine.any():
        return []
    pixels = _in_cells(nodes.views)
    own = pixels[mine].max(axis=0)
    others = pixels[~mine].max(axis=0) if (~mine).any() else np.zeros(len(CELLS))
    parts = own / np.maximum(own + others, 1e-12)
    order = sorted(np.flatnonzero(own).tolist(), key=lambda cell: (-round(float(parts[cell]), 6), -float(own[cell])))
    return [Aim(CELLS[cell], float(parts[cell])) for cell in order]


def cells_of(observation: Observation, known: Catalog) -> dict[str, Cell]:
    """Return class -> the cell at which Pick, or Place, most likely takes such a thing; large things first.

    Left out is what has most pixels in no cell. Nothing is told where the observation does not say where nodes are.
    """
    found: dict[str, Cell] = {}
    for kinds in (known.graspables, known.receptacles):
        nodes = nodes_of(observation, kinds, known)
        for name in dict.fromkeys(nodes.names):
            best = aims_at(nodes, (name,))[0]
            if best.part > SURE:
                found[name] = best.cell
    return found


def turned(nodes: Nodes, side: int) -> Nodes:
    """Return what of some things would be in view, and where, after a turn to the left (1) or to the right (-1)."""
    right, up = (2 * nodes.views[:, 0] - 1) * _FIELD, (1 - 2 * nodes.views[:, 1]) * _FIELD
    ahead, height = np.cos(_PITCH) + up * np.sin(_PITCH), up * np.cos(_PITCH) - np.sin(_PITCH)
    cosine, sine = np.cos(_TURN), side * np.sin(_TURN)
    right, ahead = right * cosine + ahead * sine, ahead * cosine - right * sine
    depth = ahead * np.cos(_PITCH) - height * np.sin(_PITCH)
    safe = np.maximum(depth, 1e-6) * _FIELD
    across, above = right / safe, (ahead * np.sin(_PITCH) + height * np.cos(_PITCH)) / safe
    share = nodes.views[:, 2] / np.maximum(depth, 1e-6) ** 3  # things look larger at the edges of a picture
    views = np.stack([(across + 1) / 2, (1 - above) / 2, share], axis=1)
    there = (depth > 0) & (abs(across) < 1) & (abs(above) < 1) & (share >= _LEAST)
    names = tuple(name for name, is_there in zip(nodes.names, there.tolist(), strict=True) if is_there)
    return Nodes(names, views[there])


def held_class(observation: Observation, known: Catalog) -> str | None:
    """Return the class of what a robot sees in a gripper, which is its own if no other robot grasps; else None."""
    if "node_state" not in observation:
        return None
    held = np.flatnonzero(observation["node_state"] == known.state_ids["held"]).tolist()
    return classes_of_nodes(observation, known)[held[0]] if held else None


def putting_away(cells: dict[str, Cell], known: Catalog) -> str | None:
    """Return the Place that puts down what was picked by mistake, on any receptacle in view; None if there is none."""
    return next(
        (aimed("place", cell) for name, cell in cells.items() if name.removeprefix(OTHER) in known.receptacles), None
    )


def number_of(actions: Sequence[str], name: str) -> int:
    """Return the number of an action; a Pick or Place that names no cell, where it has to, points at the middle."""
    return actions.index(named(name, MIDDLE) if name in VERBS and name not in actions else name)


def aimed(verb: str, cell: Cell | None) -> str:
    """Return the name of a Pick or Place at a cell, if there is one."""
    return verb if cell is None else named(verb, cell)


def _in_cells(views: Views) -> NDArray[np.float64]:
    """Return (n, cells) the share of the picture that squares of some pixels cover in each cell."""
    half, edges = np.sqrt(views[:, 2:]) / 2, np.arange(GRID + 1) / GRID
    across, down = (
        np.clip(np.minimum(middle + half, edges[1:]) - np.maximum(middle - half, edges[:-1]), 0, None)
        for middle in (views[:, :1], views[:, 1:2])
    )
    shares: NDArray[np.float64] = (down[:, :, None] * across[:, None, :]).reshape(len(views), len(CELLS))
    return shares
