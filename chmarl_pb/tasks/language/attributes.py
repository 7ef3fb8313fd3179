"""What instructions name besides classes: the colour of X ("the red mug"), the room of Y ("the bed in the bedroom")."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, COLOURS, Catalog, Name
from chmarl_pb.tasks.language.choice import may_use_held_out, pick_from
from chmarl_pb.tasks.language.names import Named, named_in, names_of, spelled
from chmarl_pb.tasks.language.tokens import words
from chmarl_pb.tasks.lookalike_task import LookalikeTask
from chmarl_pb.tasks.task import Task


def name_x(task: Task, rng: np.random.Generator, known: Catalog) -> Name:
    """Return a name of a task's X, with its colour where it has lookalikes."""
    name = pick_from(names_of(task.graspable, may_use_held_out(task), known), rng)
    return replace(name, text=f"{task.colour} {name.text}") if isinstance(task, LookalikeTask) else name


def name_y(task: Task, rng: np.random.Generator, known: Catalog) -> Name:
    """Return a name of a task's Y, with its room where that is named."""
    name = pick_from(names_of(task.target, may_use_held_out(task), known), rng)
    if not (isinstance(task, LookalikeTask) and task.room):
        return name
    return replace(name, text=f"{name.text} in {pick_from(names_of_room(task.room, may_use_held_out(task)), rng)}")


def names_of_room(room: str, held_out: bool) -> list[str]:
    """Return the names of a room: ``livingroom`` -> the lounge, ``bedroom_2`` -> bedroom 2."""
    kind = catalog.room_kind(room)
    number = room.removeprefix(kind).strip("_")
    names = [name.text for name in BENCHMARK.rooms[kind].names if held_out or not name.held_out]
    return [f"{name} {number}" if number else f"the {name}" for name in names]


def read_attributes(tokens: NDArray[np.int16], known: Catalog = BENCHMARK) -> dict[str, str]:
    """Return class -> the colour of X, or the room of Y, that an instruction names, from its token ids.

    A room is named as in a home: ``bedroom``, ``bedroom_2``. What is not named is left out.
    """
    return _read(tokens.tobytes(), known)


@lru_cache(maxsize=8192)
def _read(tokens: bytes, known: Catalog) -> dict[str, str]:
    left, found = spelled(tokens, known), {}
    for name in named_in(left, known):
        attribute = _colour_before(name, left) if name.row.kind == "graspable" else _room_after(name, left)
        if attribute:
            found[name.row.name] = attribute
    return found


def _colour_before(name: Named, left: Sequence[str]) -> str:
    word = left[name.start - 1] if name.start else ""
    return word if word in COLOURS else ""


def _room_after(name: Named, left: Sequence[str]) -> str:
    """Return the room in "in the living room", "in bedroom 2" after a name; "" if there is none."""
    rest = list(left[name.end :])
    if rest[:1] != ["in"]:
        return ""
    rest = rest[2:] if rest[1:2] == ["the"] else rest[1:]
    for length in range(len(rest), 0, -1):
        room = _rooms().get(tuple(rest[:length]))
        if room is not None:
            number = rest[length] if length < len(rest) and rest[length].isdecimal() else ""
            return f"{room}_{number}" if number else room
    return ""


@lru_cache(maxsize=1)
def _rooms() -> dict[tuple[str, ...], str]:
    """Return words of a name -> the kind of room that it names."""
    return {tuple(words(name)): row.name for row in BENCHMARK.rooms.values() for name in row.synonyms}
