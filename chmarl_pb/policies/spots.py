"""Spots: where to point without looking, as homes of training teach; ``python -m tools.build_spots``."""

import json
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from chmarl_pb.robots.pointing import Cell, named

FILE = Path(__file__).parent / "spots.json"


class Spot(NamedTuple):
    """A cell of the picture after some turns at a room's anchor.

    Attributes:
        room: whose anchor it is.
        turned: turns of 30 degrees to the left since the robot came there; below 0 to the right.
        cell: that is pointed at.
    """

    room: str
    turned: int
    cell: Cell

    def __str__(self) -> str:
        """Return the spot as a line of the file."""
        return f"{self.room} {self.turned} {self.cell[0]} {self.cell[1]}"

    def way(self, room: str, turned: int) -> list[str]:
        """Return the actions that lead there from a room's anchor, or from nowhere that is known if it is "".

        Args:
            room: whose anchor it is.
            turned: turns to the left since the robot came there.
        """
        left = self.turned - turned
        if room == self.room and abs(left) <= 1 + abs(self.turned):
            return turned_by(left)
        return [f"goto_{self.room}", *turned_by(self.turned)]

    def actions(self, verb: str) -> list[str]:
        """Return the actions that pick, or place, there."""
        return [*self.way("", 0), named(verb, self.cell)]


def turned_by(count: int) -> list[str]:
    """Return the actions that turn so many times, to the left if it is above 0."""
    return ["turn_left" if count > 0 else "turn_right"] * abs(count)


def spot_of(line: str) -> Spot:
    """Return the spot of a line of the file."""
    room, *numbers = line.split()
    turned, row, column = map(int, numbers)
    return Spot(room, turned, (row, column))


@cache
def spots_of(verb: str) -> tuple[Spot, ...]:
    """Return where to pick, or to place, first what is worth most for the steps that it takes."""
    return tuple(map(spot_of, _read()[verb]))


def tours() -> dict[str, list[str]]:
    """Return class of Y -> names of the humanoid's actions, of Picks and Places that point."""
    return {target: line.split() for target, line in _read()["tours"].items()}


@cache
def _read() -> Any:
    return json.loads(FILE.read_text(encoding="utf-8"))
