"""Names of actions that point: Pick and Place at a cell of a 3 x 3 grid of the robot's picture.

With the option ``pointing`` a robot that grasps has ``pick_0_0`` to ``pick_2_2`` (row from the top, column from the
left) in place of ``pick``, and ``place_0_0`` to ``place_2_2`` in place of ``place``.
"""

from collections.abc import Sequence

GRID = 3  # rows and columns of cells
VERBS = ("pick", "place")

Cell = tuple[int, int]  # row from the top, column from the left
CELLS: tuple[Cell, ...] = tuple((row, column) for row in range(GRID) for column in range(GRID))
MIDDLE: Cell = (GRID // 2, GRID // 2)


def named(verb: str, cell: Cell) -> str:
    """Return the name of the Pick or Place that points at a cell."""
    return f"{verb}_{cell[0]}_{cell[1]}"


_PARTS: dict[str, tuple[str, Cell]] = {named(verb, cell): (verb, cell) for verb in VERBS for cell in CELLS}


def pointing_actions(actions: Sequence[str]) -> tuple[str, ...]:
    """Return the names of a robot's actions with a Pick and a Place for each cell, in the places of the plain ones."""
    parts = [[named(name, cell) for cell in CELLS] if name in VERBS else [name] for name in actions]
    return tuple(name for part in parts for name in part)


def verb_of(action: str) -> str:
    """Return an action's name without the cell that it points at: ``pick_0_2`` -> ``pick``."""
    return _PARTS[action][0] if action in _PARTS else action


def cell_of(action: str) -> Cell | None:
    """Return the cell that an action points at; None if it does not point."""
    return _PARTS[action][1] if action in _PARTS else None


def place_of(actions: Sequence[str], verb: str) -> int | None:
    """Return where the first Pick, or Place, stands among actions, pointing or not; None if there is none."""
    return next((number for number, action in enumerate(actions) if verb_of(action) == verb), None)
