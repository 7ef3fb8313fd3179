"""The nodes of seen things and the relations between them, as rows of a scene graph; compiled by Numba at first use."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.compiled import compiled
from chmarl_pb.packed import Packed, line, table

_FIXED = catalog.BENCHMARK.state_ids["fixed"]  # of every catalogue
_IN_ROOM, _NEAR = catalog.RELATION_IDS["in_room"], catalog.RELATION_IDS["near"]
_REACH = 0.75  # metres between two movable things that are near each other
_NEIGHBOURS = 4  # nearest neighbours that get a relation


class Facts(NamedTuple):
    """What is known of every thing that could be seen, by its number.

    Attributes:
        kind: (n,) id of its class.
        state: (n,) id of its state.
        room: (n,) number of its room.
        carrier: (n,) number of what carries or holds it, -1 for nothing.
        relation: (n,) id of its relation to that.
        movable: (n,) whether it is an object or a robot.
        position: (n, 3) in metres, of what is movable.
    """

    kind: NDArray[np.int16]
    state: NDArray[np.int16]
    room: NDArray[np.int32]
    carrier: NDArray[np.int32]
    relation: NDArray[np.int16]
    movable: NDArray[np.bool_]
    position: NDArray[np.float64]

    def pack(self) -> Packed:
        """Return them as compiled functions take them."""
        return Packed(self, (*[("i2", 1)] * 2, *[("i4", 1)] * 2, ("i2", 1), ("?", 1), ("f8", 2)))


@compiled
def _facts_of(words):  # type: ignore[no-untyped-def]
    """Return packed facts."""
    return Facts(
        line(words, 0, np.int16), line(words, 1, np.int16), line(words, 2, np.int32), line(words, 3, np.int32),
        line(words, 4, np.int16), line(words, 5, np.bool_), table(words, 6, np.float64),
    )  # fmt: skip


@compiled
def describe(seen, words, room_kinds, node_class, node_state, edges):  # type: ignore[no-untyped-def]
    """Set nodes and edges of a scene graph; return the numbers of the rooms that are nodes of it.

    Args:
        seen: (n,) numbers of the seen things, the first n nodes of the graph; rooms follow.
        words: of the packed :class:`Facts`.
        room_kinds: (rooms,) ids of the classes of the rooms.
        node_class: (nodes,) zeros, set to ids of classes.
        node_state: (nodes,) zeros, set to ids of states.
        edges: (m, 3) zeros, set to source node, target node and relation; what does not fit is left out.
    """
    facts, node_of_room = _facts_of(words), np.empty(len(room_kinds), np.int32)
    present = _number_rooms(seen, facts.room, node_of_room)
    for node, number in enumerate(seen):
        node_class[node], node_state[node] = facts.kind[number], facts.state[number]
    for room in present:
        node_class[node_of_room[room]], node_state[node_of_room[room]] = room_kinds[room], _FIXED
    _relate(seen, facts, node_of_room, edges)
    return present


@compiled
def _relate(seen, facts, node_of_room, edges):  # type: ignore[no-untyped-def]
    """Set the edges."""
    near = np.empty(_NEIGHBOURS, np.int32)
    row, size = 0, len(edges)
    for node, number in enumerate(seen):
        row = _set(edges, row, size, node, int(node_of_room[facts.room[number]]), _IN_ROOM)
    for node, number in enumerate(seen):
        for other, carrier in enumerate(seen):
            if facts.carrier[number] == carrier:
                row = _set(edges, row, size, node, other, int(facts.relation[number]))
    for node, number in enumerate(seen):
        if facts.movable[number]:
            for place in range(_find_neighbours(node, seen, facts, near)):
                row = _set(edges, row, size, node, int(near[place]), _NEAR)


@compiled
def _set(edges, row, size, source, target, relation):  # type: ignore[no-untyped-def]
    """Set one row, if there is one; return the number of the next."""
    if row < size:
        edges[row, 0], edges[row, 1], edges[row, 2] = source, target, relation
    return row + 1


@compiled
def _number_rooms(seen, room_of, node_of_room):  # type: ignore[no-untyped-def]
    """Set the nodes of the rooms of seen things, -1 for the others; return the rooms that are nodes, in order."""
    for room in range(len(node_of_room)):
        node_of_room[room] = -1
    for number in seen:
        node_of_room[room_of[number]] = 0
    present, count = np.empty(len(node_of_room), np.int32), 0
    for room in range(len(node_of_room)):
        if node_of_room[room] == 0:
            node_of_room[room] = len(seen) + count
            present[count] = room
            count += 1
    return present[:count]


@compiled
def _find_neighbours(node, seen, facts, near):  # type: ignore[no-untyped-def]
    """Set ``near`` to the nodes of the nearest other movable things, the nearest first; return their number."""
    for count in range(_NEIGHBOURS):
        best, least = -1, _REACH
        for other in range(len(seen)):
            known = other == node or not facts.movable[seen[other]]
            for place in range(count):
                known |= near[place] == other
            if not known:
                square = 0.0
                for axis in range(3):
                    apart = facts.position[seen[node], axis] - facts.position[seen[other], axis]
                    square += apart * apart
                distance = np.sqrt(square)
                if distance < least:
                    best, least = other, distance
        if best < 0:
            return count
        near[count] = best
    return _NEIGHBOURS
