"""A task of tidying up: several objects, each to be brought to a receptacle of its own."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from chmarl_pb.errors import TaskError
from chmarl_pb.tasks.task import Task, check_fields

FEWEST, MOST = 2, 5  # objects


@dataclass(frozen=True)
class TidyTask:
    """One task of tidying up, beside :class:`chmarl_pb.tasks.task.Task`, the task of one object.

    Attributes:
        id: unique name.
        home: name of a packaged home or path of a home's URDF.
        moves: what is to be brought where, one task of one object each, in the order of the instruction.
        seed: fixes places, other objects, states and the robots' starts.
        optimal_steps: L*, see :func:`chmarl_pb.tasks.order.plan_all`; 0 if unknown.
    """

    id: str
    home: str
    moves: tuple[Task, ...]
    seed: int
    optimal_steps: int = 0

    def __post_init__(self) -> None:
        """Check the moves.

        Raises:
            TaskError: there are too few or too many, an object or a target is named twice, a home differs, or a field
                is of another kind.
        """
        check_fields(self, ("id", "home"))
        if not FEWEST <= len(self.moves) <= MOST:
            raise TaskError(f"task {self.id!r}: {len(self.moves)} objects; use {FEWEST} to {MOST}")
        for role in ("graspable", "target"):
            names = [getattr(move, role) for move in self.moves]
            if len(set(names)) < len(names):
                raise TaskError(f"task {self.id!r}: a {role} is named twice in {', '.join(names)}; name each once")
        if {move.home for move in self.moves} != {self.home}:
            raise TaskError(f"task {self.id!r}: its moves are not all in {self.home}")

    @property
    def graspable(self) -> str:
        """The classes of the objects."""
        return " + ".join(move.graspable for move in self.moves)

    @property
    def source(self) -> str:
        """The classes of what the objects start on."""
        return " + ".join(move.source for move in self.moves)

    @property
    def target(self) -> str:
        """The classes of the targets."""
        return " + ".join(move.target for move in self.moves)


AnyTask = Task | TidyTask


def is_task(value: object) -> bool:
    """Return whether a value is a task that files can hold: those of derived classes have more than is written."""
    return type(value) in (Task, TidyTask)


def task_of(row: Mapping[str, Any]) -> AnyTask:
    """Return the task that ``dataclasses.asdict`` has made a row of."""
    if "moves" not in row:
        return Task(**row)
    return TidyTask(**{**row, "moves": tuple(Task(**move) for move in row["moves"])})
