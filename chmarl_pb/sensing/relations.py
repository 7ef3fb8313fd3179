"""The relations between seen things, as rows of a scene graph; compiled by Numba at first use."""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

from chmarl_pb import catalog

_IN_ROOM, _NEAR = catalog.RELATION_IDS["in_room"], catalog.RELATION_IDS["near"]
_REACH = 0.75  # metres between two movable things that are near each other
_NEIGHBOURS = 4  # nearest neighbours that get a relation


class Facts(NamedTuple):
    """What is known of every thing that could be seen, by its number.

    Attributes:
        room: (n,) number of its room.
        carrier: (n,) number of what carries or holds it, -1 for nothing.
        relation: (n,) id of its relation to that.
        movable: (n,) whether it is an object or a robot.
        position: (n, 3) in metres, of what is movable.
    """

    room: NDArray[np.int32]
    carrier: NDArray[np.int32]
    relation: NDArray[np.int16]
    movable: NDArray[np.bool_]
    position: NDArray[np.float64]


@njit(cache=True)
def relate(seen, facts, rooms, edges):  # type: ignore[no-untyped-def]
    """Set the edges of a scene graph; return the numbers of the rooms that are nodes of it.

    Args:
        seen: (n,) numbers of the seen things, the first n nodes of the graph; rooms follow.
        facts: the :class:`Facts`.
        rooms: number of rooms.
        edges: (m, 3) zeros, set to source node, target node and relation; what does not fit is left out.
    """
    node_of_room = np.full(rooms, -1, np.int32)
    for number in seen:
        node_of_room[facts.room[number]] = 0
    present = np.flatnonzero(node_of_room == 0)
    for place, room in enumerate(present):
        node_of_room[room] = len(seen) + place
    row = 0
    for node, number in enumerate(seen):
        row = _add(edges, row, node, node_of_room[facts.room[number]], _IN_ROOM)
    for node, number in enumerate(seen):
        for other, carrier in enumerate(seen):
            if facts.carrier[number] == carrier:
                row = _add(edges, row, node, other, facts.relation[number])
    for node in range(len(seen)):
        if facts.movable[seen[node]]:
            row = _add_neighbours(node, seen, facts, edges, row)
    return present


@njit(cache=True)
def _add_neighbours(node, seen, facts, edges, row):  # type: ignore[no-untyped-def]
    """Relate a movable thing to the nearest others, the nearest first; return the next free row."""
    taken = np.zeros(len(seen), np.bool_)
    for _ in range(_NEIGHBOURS):
        best, least = -1, _REACH
        for other in range(len(seen)):
            if other != node and facts.movable[seen[other]] and not taken[other]:
                square = 0.0
                for axis in range(3):
                    square += (facts.position[seen[node], axis] - facts.position[seen[other], axis]) ** 2
                distance = np.sqrt(square)
                if distance < least:
                    best, least = other, distance
        if best < 0:
            break
        taken[best] = True
        row = _add(edges, row, node, best, _NEAR)
    return row


@njit(cache=True)
def _add(edges, row, source, target, relation):  # type: ignore[no-untyped-def]
    if row < len(edges):
        edges[row, 0], edges[row, 1], edges[row, 2] = source, target, relation
    return row + 1
