"""A task among lookalikes: other objects of X's class in other colours, and a room in which Y is to be.

A task of a split names classes only. What its instruction names besides is drawn from its seed alone; where the
planner cannot solve what is drawn, it is drawn anew.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import TaskError
from chmarl_pb.homes.home import Home
from chmarl_pb.tasks.sampling import sample_seed
from chmarl_pb.tasks.splits import split_of
from chmarl_pb.tasks.task import Task

_STREAM = 5  # of a task's seed; places, words, starts and states have others
_DECOYS = 3  # classes besides X's of which there are several: else the only such class would be X's


@dataclass(frozen=True)
class LookalikeTask(Task):
    """One task whose instruction names the colour of X, and the room of Y where that class is not unique in the home.

    Attributes:
        colour: of X.
        others: colours of the other objects of X's class.
        room: that Y is in; any if empty.
        decoys: names of objects of other classes, of each of which there are several, too.
    """

    colour: str = ""
    others: tuple[str, ...] = ()
    room: str = ""
    decoys: tuple[str, ...] = ()

    @property
    def item(self) -> str:
        """Name of the object X in the world."""
        return catalog.object_name(self.graspable, self.colour)

    @property
    def lookalikes(self) -> tuple[str, ...]:
        """Names of the other objects of X's class."""
        return tuple(catalog.object_name(self.graspable, colour) for colour in self.others)


def draw_lookalikes(task: Task, home: Home) -> Iterator[LookalikeTask]:
    """Yield tasks that a task may become among lookalikes, without end: the first with its own seed, then with others.

    Args:
        task: names the classes.
        home: one with several objects of each class, see :mod:`chmarl_pb.homes.lookalikes`.

    Raises:
        TaskError: the home lacks a class.
    """
    task.check(home.catalog)
    rooms, rng = _rooms(home, task.target), np.random.default_rng([task.seed, _STREAM])
    classes = [name for name in (BENCHMARK if split_of(task.id) else home.catalog).graspables if name != task.graspable]
    seed = task.seed
    while True:
        colour, *others = _some_colours(home, task.graspable, rng)
        room = rooms[int(rng.integers(len(rooms)))]
        decoys = tuple(
            catalog.object_name(name, own)
            for name in rng.permutation(classes)[:_DECOYS].tolist()
            for own in _some_colours(home, name, rng)
        )
        yield LookalikeTask(
            task.id, task.home, task.graspable, task.source, task.target, seed, 0, colour, tuple(others), room, decoys
        )
        seed = sample_seed(rng)


def _some_colours(home: Home, class_name: str, rng: np.random.Generator) -> list[str]:
    """Return two or more colours of a class."""
    colours = [colour for colour, _ in home.catalog.graspables[class_name].looks]
    drawn: list[str] = rng.permutation(colours)[: 2 + int(rng.integers(len(colours) - 1))].tolist()
    return drawn


def _rooms(home: Home, target: str) -> list[str]:
    """Return the rooms that Y may be said to be in, as often as such a thing is there; an empty one if it is unique."""
    rooms = [thing.room for thing in home.receptacles.values() if thing.class_name == target]
    if not rooms:
        raise TaskError(f"{home.name} has no {target}; choose a receptacle class that stands in the home")
    named = [room for room in rooms if catalog.room_kind(room) in home.catalog.rooms]
    return named if len(rooms) > 1 and named else [""]
