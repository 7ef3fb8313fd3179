"""The text sensor: what a robot sees, its feedback and its messages, in plain sentences, to be played by reading."""

from collections.abc import Container, Iterator
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import COLOURS
from chmarl_pb.sensing.scene_graph import SceneGraph
from chmarl_pb.sensing.sensors import View, text_space

LENGTH = 4096  # bytes; a view of everything in the fullest home takes fewer
_PLACES = ("on", "inside", "held_by")  # relations that say where an object is
_WORDS = {"held_by": "held by"}


class TextSensor:
    """Sentences: ``text``, as bytes in the observation and as a text in infos.

    The instruction; where the robot is and what it holds; what it sees, by room, with what stands where and in which
    state; what messages say; feedback, and whether the last action failed; and the names of its actions.
    """

    def __init__(self, colours: bool = False, board: bool = True):
        """Tell objects by their colours, or by their classes alone; messages of a board, or none, as of own words."""
        self._colours, self._board = colours, board

    def spaces(self) -> dict[str, spaces.Box]:
        """Return the space of texts."""
        return {"text": text_space(LENGTH)}

    def observe(self, view: View) -> dict[str, NDArray[Any] | str]:
        """Return the sentences."""
        return {"text": describe(view, self._colours, self._board)}


def describe(view: View, colours: bool = False, board: bool = True) -> str:
    """Return what a robot sees, its feedback and a board's messages; with or without colours of objects."""
    heard = _messages(view) if board else ()
    lines = [f"Task: {view.instruction}", _self(view, colours), *_seen(view, colours), *heard]
    if not view.succeeded:
        lines.append("Your last action could not be done.")
    if view.feedback:
        lines.append(f"Feedback: {view.feedback}")
    lines.append(f"Actions: {', '.join(view.actions)}.")
    return "\n".join(lines)


def _self(view: View, colours: bool) -> str:
    """Return where the robot is, and what it holds."""
    grip = view.state.grips.get(view.robot)
    holding = f" You hold the {_name(grip.item, colours)}." if grip else ""
    return f"You are the {_robot(view.robot)}, in the {_name(view.room)}.{holding}"


def _seen(view: View, colours: bool) -> Iterator[str]:
    """Yield one line for each room in which the robot sees something."""
    graph = view.graph()
    rooms: dict[str, list[str]] = {}
    places = {source: (relation, target) for source, target, relation in graph.relations() if relation in _PLACES}
    inside = {source: target for source, target, relation in graph.relations() if relation == "in_room"}
    for name, thing in zip(graph.names, _things(graph, places, view.models, colours), strict=True):
        if name in inside:
            rooms.setdefault(inside[name], []).append(thing)
    if not rooms:
        yield "You see nothing of note."
    for room, things in rooms.items():
        yield f"You see in the {_name(room)}: {', '.join(things)}."


def _things(
    graph: SceneGraph, places: dict[str, tuple[str, str]], robots: Container[str], colours: bool
) -> Iterator[str]:
    """Yield the words for each node: its name, where it is, and its state."""
    for name, state in zip(graph.names, graph.states, strict=True):
        words = _robot(name) if name in robots else _name(name, colours)
        if name in places:
            relation, target = places[name]
            words += f" {_WORDS.get(relation, relation)} the {_robot(target) if target in robots else _name(target)}"
        yield words + (f" ({state})" if state not in ("fixed", "free", "held") else "")


def _messages(view: View) -> Iterator[str]:
    """Yield what messages say, if they are the message board: rooms where X, and rooms where Y has been seen."""
    if not view.board or view.messages.shape != (2, len(view.rooms)):
        return
    for what, bits in zip(("What is to be moved", "Where it belongs"), view.messages, strict=True):
        rooms = [_name(room) for room, bit in zip(view.rooms, bits, strict=True) if bit]
        if rooms:
            yield f"{what} has been seen in the {' and the '.join(rooms)}."


def _robot(name: str) -> str:
    """Return a robot's name in words: ``humanoid_1`` -> humanoid 1."""
    return name.replace("_", " ")


def _name(name: str, colours: bool = False) -> str:
    """Return a name in words: ``kitchen/kitchen_table_2`` -> kitchen table 2, ``mug_1`` -> mug.

    With colours ``mug_3`` is the red mug.
    """
    kind = catalog.class_of(name)
    if colours and (colour := catalog.colour_of(name)):
        return f"{COLOURS[colour - 1]} {kind.replace('_', ' ')}"
    number = name.rpartition("/")[2].removeprefix(kind).removeprefix("_")
    words = kind.replace("_", " ")
    return f"{words} {number}" if number not in ("", "1") else words


def from_bytes(observed: NDArray[np.uint8]) -> str:
    """Return the text that a robot observes as bytes, see :func:`as_bytes`; half a letter at a cut is left out."""
    return observed.tobytes().rstrip(b"\0").decode(errors="ignore")


def as_bytes(text: str, length: int) -> NDArray[np.uint8]:
    """Return a text as bytes of UTF-8 (length,), filled up with zeros, or cut."""
    data = text.encode()[:length]
    array = np.zeros(length, dtype=np.uint8)
    array[: len(data)] = np.frombuffer(data, dtype=np.uint8)
    return array
