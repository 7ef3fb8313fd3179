"""Kinds of tasks: what an episode is about. The paper's is ``rearrange``; ``tidy`` brings several objects away.

A :class:`chmarl_pb.tasks.task.Task` is one row of data, as the splits have them; a ``TaskKind`` draws such rows, lays
them out, says what they ask for and judges what has become of them.
"""

from copy import copy
from dataclasses import dataclass, field
from typing import ClassVar, Protocol, runtime_checkable

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import OptionError, TaskError
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.tasks import language
from chmarl_pb.tasks.outcome import Outcome, outcome_of
from chmarl_pb.tasks.sampling import DRAWS, may_stand, receptacle_classes, sample_seed, sample_task
from chmarl_pb.tasks.setting import Setting, set_up
from chmarl_pb.tasks.splits import find_task, load_tasks
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import FEWEST, MOST, AnyTask, TidyTask
from chmarl_pb.world import World, WorldState


@runtime_checkable
class TaskKind(Protocol):
    """A kind of tasks, e.g. ``task=MyKind()``. It must be picklable and keep nothing of an episode.

    >>> class Polite(Rearrange):
    ...     def instruction(self, task):
    ...         return f"Please bring the {task.graspable} to the {task.target}."
    >>> env = chmarl_pb.parallel_env(task=Polite(), split="val-unseen")
    >>> _ = env.reset(options={"task": "val-unseen-000"})
    >>> env.instruction
    'Please bring the hairbrush to the desk.'
    """

    @property
    def objects(self) -> int:
        """The most objects that an instruction names."""

    def tasks(self, split: str) -> list[AnyTask]:
        """Return the fixed tasks of a split; if there are none, tasks are drawn for the split's homes."""

    def sample(self, space: Space, home: str, rng: np.random.Generator, task_id: str | None = None) -> AnyTask:
        """Draw a task for a home; whether it can be solved is not asked. Raise ``TaskError`` if none fits."""

    def set_up(self, world: World, space: Space, task: AnyTask) -> Setting:
        """Lay a task out in a world; the goals of the setting are the subgoals that the planner reaches."""

    def outcome(self, state: WorldState, setting: Setting, seen: dict[str, tuple[str, ...]]) -> Outcome:
        """Return the facts of a state: its potential, whose differences are the rewards, and whether it is success.

        Args:
            state: of the world.
            setting: of the episode.
            seen: robot -> names of the things that it sees.
        """

    def instruction(self, task: AnyTask) -> str:
        """Return what a task asks for, in plain English."""


@dataclass(frozen=True)
class Rearrange:
    """The paper's kind: one object X is to be brought to a receptacle Y.

    Attributes:
        catalog: whose words instructions are of; an environment sets its own.
        templates: revision of the sentences; an environment sets its own.
    """

    objects: ClassVar[int] = 1
    catalog: Catalog = field(default=BENCHMARK, repr=False)
    templates: int = field(default=1, repr=False)

    def tasks(self, split: str) -> list[AnyTask]:
        """Return the benchmark's tasks."""
        return [*load_tasks(split)]

    def sample(self, space: Space, home: str, rng: np.random.Generator, task_id: str | None = None) -> AnyTask:
        """Draw the classes of X, of its source and of Y, uniformly."""
        return sample_task(space, home, rng, task_id)

    def set_up(self, world: World, space: Space, task: AnyTask) -> Setting:
        """Put X on its source, other objects somewhere, and draw states and starts."""
        task = self._own(task)
        return set_up(world, space, task, (task,))

    def outcome(self, state: WorldState, setting: Setting, seen: dict[str, tuple[str, ...]]) -> Outcome:
        """Return the paper's potential."""
        return outcome_of(state, setting.goal, seen, setting.graspers, setting.rooms)

    def instruction(self, task: AnyTask) -> str:
        """Return one sentence."""
        return _sentence(self._own(task), self.catalog, self.templates)

    def _own(self, task: AnyTask) -> Task:
        if not isinstance(task, Task):
            raise TaskError(f"task {task.id!r} is a {type(task).__name__}; play it in parallel_env(task='tidy')")
        return task


@dataclass(frozen=True)
class Tidy:
    """Several objects, each to be brought to a receptacle of another class.

    The potential is the sum of the paper's over the objects; success is when all stand where they belong.

    Attributes:
        fewest: objects in a task.
        most: objects in a task.
        catalog: whose words instructions are of; an environment sets its own.
        templates: revision of the sentences; an environment sets its own.
    """

    fewest: int = FEWEST
    most: int = MOST
    catalog: Catalog = field(default=BENCHMARK, repr=False)
    templates: int = field(default=1, repr=False)

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            OptionError: they are not from 2 to 5, in this order.
        """
        if not FEWEST <= self.fewest <= self.most <= MOST:
            raise OptionError(f"{self}: use {FEWEST} to {MOST} objects, the fewest first")

    @property
    def objects(self) -> int:
        """The most objects that an instruction names."""
        return self.most

    def tasks(self, split: str) -> list[AnyTask]:
        """Return none: tasks are drawn."""
        return []

    def sample(self, space: Space, home: str, rng: np.random.Generator, task_id: str | None = None) -> AnyTask:
        """Draw the number of objects, then the classes of objects, targets and sources, uniformly."""
        count = int(rng.integers(self.fewest, self.most + 1))
        classes = receptacle_classes(space, max(count, 2))
        items, sources, targets = _draw_moves(space.home.catalog, classes, count, rng)
        seed = sample_seed(rng)
        name = task_id or f"{space.home.name}-tidy-{seed}"
        moves = tuple(
            Task(f"{name}.{number}", home, item, source, target, seed + number)
            for number, (item, source, target) in enumerate(zip(items, sources, targets, strict=True))
        )
        return TidyTask(name, home, moves, seed)

    def set_up(self, world: World, space: Space, task: AnyTask) -> Setting:
        """Put every object on its source, other objects somewhere, and draw states and starts."""
        task = self._own(task)
        return set_up(world, space, task, task.moves)

    def outcome(self, state: WorldState, setting: Setting, seen: dict[str, tuple[str, ...]]) -> Outcome:
        """Return the sum of the potentials."""
        parts = tuple(outcome_of(state, goal, seen, setting.graspers, setting.rooms) for goal in setting.goals)
        phi, success = sum(part.potential for part in parts), all(part.success for part in parts)
        return Outcome(state, seen, parts[0].item_room, phi, success, parts)

    def instruction(self, task: AnyTask) -> str:
        """Return one sentence for each object."""
        return " ".join(_sentence(move, self.catalog, self.templates) for move in self._own(task).moves)

    def _own(self, task: AnyTask) -> TidyTask:
        if not isinstance(task, TidyTask):
            raise TaskError(f"task {task.id!r} is of one object; play it in parallel_env(task='rearrange')")
        return task


def _sentence(move: Task, known: Catalog, templates: int) -> str:
    move.check(known)
    return language.instruction(move, known, templates)


def _draw_moves(
    known: Catalog, classes: list[str], count: int, rng: np.random.Generator
) -> tuple[list[str], list[str], list[str]]:
    """Return classes of objects, sources and targets; own objects where they may stand."""
    for _ in range(DRAWS):
        items = rng.choice(list(known.graspables), size=count, replace=False).tolist()
        targets = rng.choice(classes, size=count, replace=False).tolist()
        sources = [str(rng.choice([name for name in classes if name != target])) for target in targets]
        if all(may_stand(known, *move) for move in zip(items, sources, targets, strict=True)):
            return items, sources, targets
    raise TaskError(f"no {count} objects were found that may stand on {', '.join(classes)}; widen their 'places'")


REARRANGE = Rearrange()

#: Name -> kind.
KINDS: dict[str, TaskKind] = {"rearrange": REARRANGE, "tidy": Tidy()}


def named_task(kind: TaskKind, split: str, task_id: str) -> AnyTask:
    """Return a task by its id: one of those that a kind has for a split, or of any of the benchmark's splits.

    Raises:
        TaskError: there is no such task.
    """
    own = (task for task in kind.tasks(split) if task.id == task_id)
    return next(own, None) or find_task(task_id)


def speaking_of(kind: TaskKind, known: Catalog, templates: int) -> TaskKind:
    """Return a kind whose instructions name the classes of a catalogue; one of the user's own as it is.

    Args:
        kind: the kind.
        known: the catalogue.
        templates: revision of the sentences.
    """
    if not isinstance(kind, Rearrange | Tidy) or (kind.catalog == known and kind.templates == templates):
        return kind
    speaking = copy(kind)
    object.__setattr__(speaking, "catalog", known)
    object.__setattr__(speaking, "templates", templates)
    return speaking
