"""What is in a robot's view: from its scene graph, or where there is none, as with pictures, the truth of its infos."""

from typing import Any

import numpy as np

from chmarl_pb import catalog
from chmarl_pb.catalog import Catalog

Observation = dict[str, np.ndarray]
Info = dict[str, Any]

_IN_ROOM, _ON = catalog.RELATION_IDS["in_room"], catalog.RELATION_IDS["on"]


def classes_in_view(observation: Observation, info: Info, known: Catalog) -> frozenset[str]:
    """Return the classes of what is in view."""
    if "node_class" in observation:
        return frozenset(known.rows[number - 1].name for number in observation["node_class"].tolist() if number)
    return frozenset(map(catalog.class_of, info["visible"]))


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
    return [(catalog.class_of(name), catalog.room_of(name) if "/" in name else own) for name in names]


def supports_in_view(observation: Observation, known: Catalog) -> dict[str, str]:
    """Return the class of an object -> that of the receptacle on which it stands, as far as a graph shows both."""
    if "edges" not in observation:
        return {}
    ids, edges = observation["node_class"], observation["edges"]
    pairs = edges[edges[:, 2] == _ON, :2].tolist()
    return {known.rows[ids[item] - 1].name: known.rows[ids[support] - 1].name for item, support in pairs}


def own_room(observation: Observation, rooms: tuple[str, ...]) -> str:
    """Return the room that a robot is in, "" if it is none of these."""
    number = int(np.argmax(observation["self"][: len(rooms) + 1]))
    return rooms[number] if number < len(rooms) else ""


def _in_graph(observation: Observation, rooms: tuple[str, ...], known: Catalog) -> list[tuple[str, str]]:
    own, held = own_room(observation, rooms), known.state_ids["held"]
    names = [known.rows[number - 1].name if number else "" for number in observation["node_class"].tolist()]
    edges = observation["edges"][observation["edges"][:, 2] == _IN_ROOM, :2].tolist()
    return [
        (names[node], _room(names[room], own, rooms)) for node, room in edges if observation["node_state"][node] != held
    ]  # fmt: skip


def _room(kind: str, own: str, rooms: tuple[str, ...]) -> str:
    alike = [room for room in rooms if catalog.room_kind(room) == kind]
    return own if own in alike or not alike else alike[0]
