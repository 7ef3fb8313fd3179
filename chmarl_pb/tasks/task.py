"""A task: which object, from where, to where, in which home; its seed fixes everything else."""

from dataclasses import dataclass

from chmarl_pb import catalog
from chmarl_pb.errors import TaskError


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
        """Check the classes.

        Raises:
            TaskError: a class is unknown, the seed is negative, or the task would be solved at its start.
        """
        if self.graspable not in catalog.GRASPABLES:
            raise TaskError(f"task {self.id!r}: unknown graspable {self.graspable!r}; see catalog.GRASPABLES")
        for role in (self.source, self.target):
            if role not in catalog.RECEPTACLES:
                raise TaskError(f"task {self.id!r}: unknown receptacle {role!r}; see catalog.RECEPTACLES")
        if self.source == self.target:
            raise TaskError(f"task {self.id!r}: source and target are both {self.source!r}; choose another target")
        if self.seed < 0:
            raise TaskError(f"task {self.id!r}: the seed {self.seed} is negative; use 0 or more")

    @property
    def item(self) -> str:
        """Name of the object X in the world."""
        return f"{self.graspable}_1"

    @property
    def moves(self) -> tuple["Task", ...]:
        """What is to be brought where: this alone; a task of tidying up has several moves."""
        return (self,)
