"""The scene graph of what one robot sees: classes and states of things, and relations between them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.homes.space import Space
from chmarl_pb.world import Support, World

#: Most nodes of a graph: things of a home, objects, robots and rooms; ``homes check`` holds homes to it.
MAX_NODES = 96
#: Most edges: one in_room a thing, one on/inside/held_by an object, ``_NEIGHBOURS`` near a movable thing.
MAX_EDGES = 192

_NEAR = 0.75  # metres between two movable things that are near each other
_NEIGHBOURS = 4  # nearest neighbours that get a relation


@dataclass(frozen=True, eq=False)
class SceneGraph:
    """A graph with named nodes.

    Attributes:
        names: of the nodes; a room's name for a room.
        states: of the nodes.
        edges: (source node, target node, relation name).
    """

    names: tuple[str, ...]
    states: tuple[str, ...]
    edges: tuple[tuple[int, int, str], ...]

    def arrays(self) -> dict[str, NDArray[np.int16]]:
        """Return ``node_class`` (MAX_NODES,), ``node_state`` (MAX_NODES,) and ``edges`` (MAX_EDGES, 3).

        Classes, states and relations are ids of the catalogue, 0 is padding; an edge is a row of
        source node, target node, relation.
        """
        node_class = np.zeros(MAX_NODES, dtype=np.int16)
        node_state = np.zeros(MAX_NODES, dtype=np.int16)
        edges = np.zeros((MAX_EDGES, 3), dtype=np.int16)
        node_class[: len(self.names)] = [catalog.CLASS_IDS[catalog.class_of(name)] for name in self.names]
        node_state[: len(self.names)] = [catalog.STATE_IDS[state] for state in self.states]
        for row, (source, target, relation) in enumerate(self.edges):
            edges[row] = source, target, catalog.RELATION_IDS[relation]
        return {"node_class": node_class, "node_state": node_state, "edges": edges}


def scene_graph(world: World, space: Space, seen: tuple[str, ...], states: Mapping[str, str]) -> SceneGraph:
    """Return the graph of the things that a robot sees and the rooms that they are in.

    Args:
        world: the world.
        space: what its home offers.
        seen: names of the visible things.
        states: the symbolic states of things and objects.
    """
    where = {name: _room(world, name) for name in seen}
    rooms = [room for room in world.home.rooms if room in where.values()]
    names = (*seen, *rooms)
    index = {name: number for number, name in enumerate(names)}
    edges = [(index[name], index[room], "in_room") for name, room in where.items()]
    edges += [edge for name in seen for edge in _carried(world, space, name, index)]
    edges += _near(world, [name for name in seen if name in world.bodies], index)
    return SceneGraph(names, tuple(_state(world, name, states) for name in names), tuple(edges))


def _room(world: World, name: str) -> str:
    if name in world.robots:
        return list(world.home.rooms)[world.robots[name].room]
    if name == world.held:
        return _room(world, "humanoid")
    return catalog.room_of(world.supports[name].receptacle if name in world.supports else name)


def _state(world: World, name: str, states: Mapping[str, str]) -> str:
    if name in world.robots:
        return "holding" if name == "humanoid" and world.held else "free"
    return "held" if name == world.held else states.get(name, "fixed")


def _carried(world: World, space: Space, name: str, index: Mapping[str, int]) -> list[tuple[int, int, str]]:
    """Return the edge to what carries an object, if both are seen."""
    if name == world.held and "humanoid" in index:
        return [(index[name], index["humanoid"], "held_by")]
    support = world.supports.get(name)
    if support is None or support.receptacle not in index:
        return []
    return [(index[name], index[support.receptacle], "inside" if _is_covered(space, support) else "on")]


def _is_covered(space: Space, support: Support) -> bool:
    return any(
        surface.covered and surface.receptacle == support.receptacle and abs(surface.height - support.height) < 0.01
        for surface in space.surfaces
    )


def _near(world: World, movable: list[str], index: Mapping[str, int]) -> list[tuple[int, int, str]]:
    if len(movable) < 2:
        return []
    points = np.array([_position(world, name) for name in movable])
    distance = np.linalg.norm(points[:, None] - points, axis=-1)
    np.fill_diagonal(distance, np.inf)
    edges = []
    for row, name in enumerate(movable):
        for column in np.argsort(distance[row], kind="stable")[:_NEIGHBOURS]:
            if distance[row, column] < _NEAR:
                edges.append((index[name], index[movable[column]], "near"))
    return edges


def _position(world: World, name: str) -> tuple[float, ...]:
    return world.robots[name].base_pose()[0] if name in world.robots else world.pose(name)[0]
