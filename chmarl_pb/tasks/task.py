"""A task: which object, from where, to where, in which home; its seed fixes everything else."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from numbers import Integral
from typing import Any

from chmarl_pb.catalog import Catalog
from chmarl_pb.errors import TaskError

_NUMBERS = {"seed": Integral, "optimal_steps": Integral}


def check_fields(task: Any, texts: Sequence[str]) -> None:
    """Check the plain fields of a task: some texts, and its numbers.

    Raises:
        TaskError: one is of another kind, or the seed is negative.
    """
    for name, kind in {**dict.fromkeys(texts, str), **_NUMBERS}.items():
        if not isinstance(getattr(task, name), kind):
            raise TaskError(f"task {str(task.id)[:80]!r}: its {name} is {str(getattr(task, name))[:80]!r}")
    if task.seed < 0:
        raise TaskError(f"task {task.id!r}: the seed {task.seed} is negative; use 0 or more")


@dataclass(frozen=True)
class Task:
    """One task of the benchmark.

    Attributes:
        id: unique name, e.g. ``test-unseen-007``.
        home: name of a packaged home or path of a home's URDF.
        graspable: class X of the object to be moved.
        source: class of the receptacle that X starts on.
        target: class Y of the receptacle that X is to be placed on; any such thing of the home will do.
        seed: fixes places, other objects, states, the robots' starts and the wording.
        optimal_steps: L*, the least number of joint steps that solves it; 0 if unknown.
    """

    id: str
    home: str
    graspable: str
    source: str
    target: str
    seed: int
    optimal_steps: int = 0

    def __post_init__(self) -> None:
        """Check what needs no catalogue; whether the classes are known is asked when the task is laid out.

        Raises:
            TaskError: a field is of another kind, the seed is negative, or the task would be solved at its start.
        """
        check_fields(self, ("id", "home", "graspable", "source", "target"))
        if self.source == self.target:
            raise TaskError(f"task {self.id!r}: source and target are both {self.source!r}; choose another target")

    def check(self, known: Catalog) -> None:
        """Check that its classes are those of a catalogue.

        Raises:
            TaskError: one is not.
        """
        self._check("graspable", self.graspable, known.graspables)
        self._check("receptacle", self.source, known.receptacles)
        self._check("receptacle", self.target, known.receptacles)

    def _check(self, kind: str, name: str, rows: Collection[str]) -> None:
        if name not in rows:
            near = get_close_matches(name, rows, 1, 0.8)
            hint = f"did you mean {near[0]!r}?" if near else "own classes need catalog=, the file that they stand in"
            raise TaskError(f"task {self.id!r}: unknown {kind} {name!r}; {hint}")

    @property
    def item(self) -> str:
        """Name of the object X in the world."""
        return f"{self.graspable}_1"

    @property
    def moves(self) -> tuple["Task", ...]:
        """What is to be brought where: this alone; a task of tidying up has several moves."""
        return (self,)


@dataclass(frozen=True)
class Optimum:
    """L* of a task.

    Attributes:
        steps: joint steps.
        proven: whether no plan takes fewer; if not, they are an upper bound.
    """

    steps: int
    proven: bool = True
