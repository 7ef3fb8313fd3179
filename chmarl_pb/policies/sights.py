"""What is in a robot's view: from its scene graph, or where there is none, as with pictures, the truth of its infos.

Where the instruction names the colour of X, or the room of Y, only that is known by the name of its class; X's
lookalikes, and such things in other rooms, are known as others: ``other mug``.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import COLOUR_IDS, Catalog
from chmarl_pb.tasks.language import read_attributes, read_pairs

Observation = dict[str, np.ndarray]
Info = dict[str, Any]

OTHER = "other "  # before the class of what the instruction does not ask for

_IN_ROOM, _ON = catalog.RELATION_IDS["in_room"], catalog.RELATION_IDS["on"]


def classes_in_view(observation: Observation, info: Info, known: Catalog) -> frozenset[str]:
    """Return the classes of what is in view."""
    if "node_class" in observation:
        return frozenset(filter(None, classes_of_nodes(observation, known)))
    return frozenset(classes_of_names(observation, info["visible"], known))


def places_in_view(
    observation: Observation, info: Info, rooms: tuple[str, ...], known: Catalog
) -> list[tuple[str, str]]:
    """Return class and room of each thing in view that stands somewhere; what is held does not.

    A graph names the kind of a room only: of several alike it is taken for the robot's own, or the first. Without a
    graph an object is taken to be in the robot's own room.
    """
    if "edges" in observation:
        return _in_graph(observation, rooms, known)
    own = own_room(observation, rooms)
    names = [name for name in info["visible"] if not (observation["self"][-1] and "/" not in name)]
    classes = classes_of_names(observation, names, known)
    return [
        (kind, catalog.room_of(name) if "/" in name else own) for kind, name in zip(classes, names, strict=True)
    ]  # fmt: skip


def supports_in_view(observation: Observation, known: Catalog) -> dict[str, str]:
    """Return the class of an object -> that of the receptacle on which it stands, as far as a graph shows both."""
    if "edges" not in observation:
        return {}
    ids, edges = observation["node_class"], observation["edges"]
    pairs = edges[edges[:, 2] == _ON, :2].tolist()
    return {known.rows[ids[item] - 1].name: known.rows[ids[support] - 1].name for item, support in pairs}


def colors_in_view(observation: Observation, known: Catalog) -> dict[str, frozenset[int]]:
    """Return the class of each object in view -> ids of the colours in which it is; empty where graphs tell none."""
    found: dict[str, frozenset[int]] = {}
    if "node_color" in observation:
        for number, color in zip(observation["node_class"].tolist(), observation["node_color"].tolist(), strict=True):
            if color:
                name = known.rows[number - 1].name
                found[name] = found.get(name, frozenset()) | {color}
    return found


def own_room(observation: Observation, rooms: tuple[str, ...]) -> str:
    """Return the room that a robot is in, "" if it is none of these."""
    number = int(np.argmax(observation["self"][: len(rooms) + 1]))
    return rooms[number] if number < len(rooms) else ""


def messages_read(
    observation: Observation, rooms: tuple[str, ...], known: Catalog, key: str = "messages"
) -> NDArray[np.int8]:
    """Return the board (2, rooms) with what the instruction says: the room of Y, if it names that.

    Args:
        observation: of a robot.
        rooms: in the order of their bits.
        known: the classes that instructions name.
        key: of the board, if the observation has it; else it is that of the messages.
    """
    board: NDArray[np.int8] = observation.get(key, observation["messages"])
    asked = _asked(observation, known)
    named = [asked[target] for _, target in read_pairs(observation["instruction"], known) if target in asked]
    if not set(named) & set(rooms):
        return board
    board = board.copy()
    board[1] |= np.array([room in named for room in rooms], board.dtype)
    return board


def classes_of_nodes(observation: Observation, known: Catalog) -> list[str]:
    """Return the class of each node of a graph, "" for padding."""
    names = [known.rows[number - 1].name if number else "" for number in observation["node_class"].tolist()]
    asked = _asked(observation, known)
    return [_known_as(name, node, asked, observation, names) for node, name in enumerate(names)] if asked else names


def _asked(observation: Observation, known: Catalog) -> dict[str, str]:
    """Return class -> colour or room that the instruction names; nothing for who does not read it."""
    return read_attributes(observation["instruction"], known) if "instruction" in observation else {}


def _known_as(name: str, node: int, asked: dict[str, str], observation: Observation, names: list[str]) -> str:
    """Return the class of a node, or that it is another than the instruction asks for: of another colour or room."""
    attribute = asked.get(name)
    if attribute is None:
        return name
    if attribute in COLOUR_IDS:
        fits = "node_color" not in observation or observation["node_color"][node] == COLOUR_IDS[attribute]
    else:
        edges = observation["edges"]
        rooms = edges[(edges[:, 2] == _IN_ROOM) & (edges[:, 0] == node), 1].tolist()
        fits = any(names[room] == catalog.room_kind(attribute) for room in rooms)
    return name if fits else f"{OTHER}{name}"


def classes_of_names(observation: Observation, names: "tuple[str, ...] | list[str]", known: Catalog) -> list[str]:
    """Return the class of each name of what is in view."""
    asked, classes = _asked(observation, known), list(map(catalog.class_of, names))
    for number, (kind, name) in enumerate(zip(classes, names, strict=True)):
        attribute = asked.get(kind) if asked else None
        if attribute and attribute != _attribute_of(name):
            classes[number] = f"{OTHER}{kind}"
    return classes


def _attribute_of(name: str) -> str:
    """Return the colour of an object, or the room of a thing of the home."""
    return catalog.room_of(name) if "/" in name else catalog.COLOURS[catalog.colour_of(name) - 1]


def _in_graph(observation: Observation, rooms: tuple[str, ...], known: Catalog) -> list[tuple[str, str]]:
    own, held = own_room(observation, rooms), known.state_ids["held"]
    names = classes_of_nodes(observation, known)
    edges = observation["edges"][observation["edges"][:, 2] == _IN_ROOM, :2].tolist()
    return [
        (names[node], _room(names[room], own, rooms)) for node, room in edges if observation["node_state"][node] != held
    ]  # fmt: skip


def _room(kind: str, own: str, rooms: tuple[str, ...]) -> str:
    alike = [room for room in rooms if catalog.room_kind(room) == kind]
    return own if own in alike or not alike else alike[0]
