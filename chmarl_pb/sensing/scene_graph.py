"""The scene graph of what one robot sees: classes and states of things, and relations between them."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.sensing.relations import Facts, describe
from chmarl_pb.world import Support, World

#: Most nodes of a graph: things of a home, objects, robots and rooms; ``homes check`` holds homes to it.
MAX_NODES = 96
#: Most edges: one in_room a thing, one on/inside/held_by an object, some near a movable thing.
MAX_EDGES = 192

_ON, _INSIDE = catalog.RELATION_IDS["on"], catalog.RELATION_IDS["inside"]
_RELATIONS = {number: name for name, number in catalog.RELATION_IDS.items()}


@dataclass(frozen=True, eq=False)
class SceneGraph:
    """A graph with named nodes, as arrays; ids are those of the catalogue, 0 is padding.

    Attributes:
        names: of the nodes; a room's name for a room.
        node_class: (MAX_NODES,) int16.
        node_state: (MAX_NODES,) int16.
        edges: (MAX_EDGES, 3) int16 source node, target node, relation.
    """

    names: tuple[str, ...]
    node_class: NDArray[np.int16]
    node_state: NDArray[np.int16]
    edges: NDArray[np.int16]

    def arrays(self) -> dict[str, np.ndarray]:
        """Return new ``node_class``, ``node_state`` and ``edges`` by name."""
        return {
            "node_class": self.node_class.copy(), "node_state": self.node_state.copy(), "edges": self.edges.copy()
        }  # fmt: skip

    @property
    def states(self) -> tuple[str, ...]:
        """The states of the nodes."""
        return tuple(catalog.STATES[number - 1] for number in self.node_state[: len(self.names)].tolist())

    def relations(self) -> Iterator[tuple[str, str, str]]:
        """Yield the names of source, target and relation of each edge."""
        for source, target, relation in self.edges[self.edges[:, 2] > 0].tolist():
            yield self.names[source], self.names[target], _RELATIONS[relation]


class SceneGraphs:
    """Makes the scene graphs of one world."""

    def __init__(self, world: World, space: Space, names: tuple[str, ...]):
        """Prepare to describe a world.

        Args:
            world: the world.
            space: what its home offers.
            names: every name that can be visible, see :class:`chmarl_pb.sensing.vision.Sight`.
        """
        self._world, self._space = world, space
        self._rooms = list(world.home.rooms)
        self._numbers = {name: number for number, name in enumerate(names)}
        self._room_classes = np.array(
            [catalog.CLASS_IDS.get(catalog.class_of(room), 0) for room in self._rooms], dtype=np.int16
        )
        static = [self._rooms.index(catalog.room_of(name)) if name in world.links else -1 for name in names]
        count = len(names)
        self._facts = Facts(
            kind=np.array([catalog.CLASS_IDS.get(catalog.class_of(name), 0) for name in names], dtype=np.int16),
            state=np.zeros(count, dtype=np.int16),
            room=np.array(static, dtype=np.int32),
            carrier=np.full(count, -1, dtype=np.int32),
            relation=np.zeros(count, dtype=np.int16),
            movable=np.zeros(count, dtype=np.bool_),
            position=np.zeros((count, 3)),
        )
        self._known: tuple[int, Mapping[str, str]] | None = None
        self._carried: tuple[str | None, dict[str, Support]] | None = None
        self._covered: dict[Support, bool] = {}
        self._kept: dict[tuple[str, ...], SceneGraph] = {}  # of things that have not moved

    def graph(self, seen: tuple[str, ...], states: Mapping[str, str]) -> SceneGraph:
        """Return the graph of the things that a robot sees and the rooms that they are in.

        Args:
            seen: names of the visible things, in the order of all names.
            states: the symbolic states of things and objects.
        """
        known = self._world.version, states
        if self._known is None or self._known[0] != known[0] or self._known[1] is not states:
            self._learn_objects(states)
            self._known = known
        graph = self._kept.get(seen)
        if graph is None:
            still = self._world.held is None and self._world.robots.keys().isdisjoint(seen)
            if not still:
                self._learn_robots()
            graph = self._make(seen)
            if still:
                self._kept[seen] = graph
        return graph

    def _make(self, seen: tuple[str, ...]) -> SceneGraph:
        numbers = np.array(list(map(self._numbers.__getitem__, seen)), dtype=np.int32)
        node_class, node_state = np.zeros((2, MAX_NODES), dtype=np.int16)
        edges = np.zeros((MAX_EDGES, 3), dtype=np.int16)
        present = describe(numbers, self._facts, self._room_classes, node_class, node_state, edges)
        return SceneGraph((*seen, *[self._rooms[room] for room in present.tolist()]), node_class, node_state, edges)

    def _learn_robots(self) -> None:
        facts, world = self._facts, self._world
        for name, robot in world.robots.items():
            number = self._numbers[name]
            facts.room[number], facts.position[number] = robot.room, robot.base_pose()[0]
        if world.held is not None:
            facts.room[self._numbers[world.held]] = world.robots["humanoid"].room

    def _learn_objects(self, states: Mapping[str, str]) -> None:
        facts, world = self._facts, self._world
        self._kept.clear()
        objects = world.objects
        if objects:
            facts.position[[self._numbers[name] for name in objects]] = [world.pose(name)[0] for name in objects]
        carried = world.held, dict(world.supports)
        if self._carried == carried and self._known is not None and self._known[1] is states:
            return  # only the held object has moved
        self._carried = carried
        facts.movable[:], facts.carrier[:] = False, -1
        facts.movable[[self._numbers[name] for name in (*objects, *world.robots)]] = True
        numbers = [self._numbers[name] for name in world.supports]
        carriers = [self._numbers[support.receptacle] for support in world.supports.values()]
        facts.carrier[numbers], facts.room[numbers] = carriers, facts.room[carriers]
        facts.relation[numbers] = [_INSIDE if self._is_covered(support) else _ON for support in world.supports.values()]
        if world.held is not None:
            number = self._numbers[world.held]
            facts.carrier[number], facts.relation[number] = self._numbers["humanoid"], catalog.RELATION_IDS["held_by"]
        self._learn_states(states)

    def _learn_states(self, states: Mapping[str, str]) -> None:
        held = self._world.held
        robots = {name: "holding" if name == "humanoid" and held else "free" for name in self._world.robots}
        known = {**states, **robots, **({held: "held"} if held else {})}
        self._facts.state[:] = [catalog.STATE_IDS[known.get(name, "fixed")] for name in self._numbers]

    def _is_covered(self, support: Support) -> bool:
        if support not in self._covered:
            self._covered[support] = any(
                surface.covered and surface.receptacle == support.receptacle
                and abs(surface.height - support.height) < 0.01
                for surface in self._space.surfaces
            )  # fmt: skip
        return self._covered[support]
