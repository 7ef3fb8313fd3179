"""Where to point: the cells of the picture that name what a robot sees, as far as its observation tells."""

from collections.abc import Sequence

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.robots.pointing import MIDDLE, VERBS, Cell, cell_at, named

Observation = dict[str, np.ndarray]


def cells_of(observation: Observation, known: Catalog) -> dict[str, Cell]:
    """Return class -> the cell at which Pick, or Place, takes such a thing: that of its middle; large things first.

    Left out is what has the middle of a larger object, or receptacle, in the same cell: that most likely has most
    pixels there. Nothing is told where the observation does not say where nodes are.
    """
    if "node_view" not in observation:
        return {}
    ids, states = observation["node_class"], observation["node_state"]
    views, held = observation["node_view"].tolist(), known.state_ids["held"]
    found: dict[str, Cell] = {}
    for kind in (known.graspables, known.receptacles):
        nodes = [
            number for number in np.flatnonzero(ids).tolist()
            if _name(ids[number], known) in kind and states[number] != held and views[number][2] > 0
        ]  # fmt: skip
        taken: set[Cell] = set()
        for number in sorted(nodes, key=lambda number: -views[number][2]):
            cell = cell_at(*views[number][:2])
            if cell not in taken:
                found.setdefault(_name(ids[number], known), cell)
            taken.add(cell)
    return found


def held_class(observation: Observation, known: Catalog) -> str | None:
    """Return the class of what a robot sees in a gripper, which is its own if no other robot grasps; else None."""
    if "node_state" not in observation:
        return None
    held = np.flatnonzero(observation["node_state"] == known.state_ids["held"]).tolist()
    return _name(observation["node_class"][held[0]], known) if held else None


def putting_away(cells: dict[str, Cell], known: Catalog) -> str | None:
    """Return the Place that puts down what was picked by mistake, on any receptacle in view; None if there is none."""
    return next((aimed("place", cell) for name, cell in cells.items() if name in known.receptacles), None)


def number_of(actions: Sequence[str], name: str) -> int:
    """Return the number of an action; a Pick or Place that names no cell, where it has to, points at the middle."""
    return actions.index(named(name, MIDDLE) if name in VERBS and name not in actions else name)


def aimed(verb: str, cell: Cell | None) -> str:
    """Return the name of a Pick or Place at a cell, if there is one."""
    return verb if cell is None else named(verb, cell)


def _name(number: int, known: Catalog) -> str:
    return known.rows[number - 1].name
