"""The scene graph of what one robot sees: classes and states of things, and relations between them."""

from collections.abc import Collection, Iterator, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.rendering.renderer import classes_of
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.sensing.relations import Facts, describe
from chmarl_pb.world import Grip, Objects, RobotState, Support, WorldState

#: Most nodes of a graph: things of a home, objects, robots and rooms; ``homes check`` holds homes to it.
MAX_NODES = 96
#: Most edges: one in_room a thing, one on/inside/held_by an object, some near a movable thing.
MAX_EDGES = 192

_ON, _INSIDE = catalog.RELATION_IDS["on"], catalog.RELATION_IDS["inside"]
_RELATIONS = {number: name for name, number in catalog.RELATION_IDS.items()}


class SceneGraph(NamedTuple):
    """A graph with named nodes, as arrays; ids are those of the catalogue, 0 is padding.

    Attributes:
        names: of the nodes; a room's name for a room.
        node_class: (MAX_NODES,) int16.
        node_state: (MAX_NODES,) int16.
        edges: (MAX_EDGES, 3) int16 source node, target node, relation.
        catalog: what the ids are of.
    """

    names: tuple[str, ...]
    node_class: NDArray[np.int16]
    node_state: NDArray[np.int16]
    edges: NDArray[np.int16]
    catalog: Catalog = BENCHMARK

    def arrays(self) -> dict[str, np.ndarray]:
        """Return new ``node_class``, ``node_state`` and ``edges`` by name."""
        return {
            "node_class": self.node_class.copy(), "node_state": self.node_state.copy(), "edges": self.edges.copy()
        }  # fmt: skip

    @property
    def states(self) -> tuple[str, ...]:
        """The states of the nodes."""
        return tuple(self.catalog.states[number - 1] for number in self.node_state[: len(self.names)].tolist())

    def relations(self) -> Iterator[tuple[str, str, str]]:
        """Yield the names of source, target and relation of each edge."""
        for source, target, relation in self.edges[self.edges[:, 2] > 0].tolist():
            yield self.names[source], self.names[target], _RELATIONS[relation]


class SceneGraphs:
    """Makes the scene graphs of one home.

    Attributes:
        catalog: what the ids are of.
    """

    def __init__(self, space: Space, links: Collection[str], names: tuple[str, ...], robots: Mapping[str, RobotModel]):
        """Prepare to describe a home.

        Args:
            space: what the home offers.
            links: names of the parts of the home.
            names: every name that can be visible, see :class:`chmarl_pb.rendering.renderer.Renderer`.
            robots: robot -> its kind.
        """
        self.catalog = space.home.catalog
        self._rooms = list(space.home.rooms)
        self._numbers = {name: number for number, name in enumerate(names)}
        self._room_classes = np.array(
            [self.catalog.class_ids.get(catalog.class_of(room), 0) for room in self._rooms], dtype=np.int16
        )
        static = [self._rooms.index(catalog.room_of(name)) if name in links else -1 for name in names]
        count = len(names)
        self._facts = Facts(
            kind=np.array([self.catalog.class_ids.get(name, 0) for name in classes_of(names, robots)], dtype=np.int16),
            state=np.zeros(count, dtype=np.int16),
            room=np.array(static, dtype=np.int32),
            carrier=np.full(count, -1, dtype=np.int32),
            relation=np.zeros(count, dtype=np.int16),
            movable=np.zeros(count, dtype=np.bool_),
            position=np.zeros((count, 3)),
        )
        self._packed = self._facts.pack()
        self._covered: dict[str, list[float]] = {}  # receptacle -> heights of its surfaces that have one above them
        for surface in space.surfaces:
            if surface.covered:
                self._covered.setdefault(surface.receptacle, []).append(surface.height)
        # What the facts and the kept graphs follow from; compared by identity.
        self._objects = Objects()
        self._grips: Mapping[str, Grip] = {}
        self._states: Mapping[str, str] = {}
        self._robots: Mapping[str, RobotState] = {}
        self._kept: dict[tuple[str, ...], SceneGraph] = {}  # of things that have not moved

    def graph(self, state: WorldState, seen: tuple[str, ...], states: Mapping[str, str]) -> SceneGraph:
        """Return the graph of the things that a robot sees and the rooms that they are in.

        Args:
            state: of the world.
            seen: names of the visible things, in the order of all names.
            states: the symbolic states of things and objects.
        """
        if state.objects is not self._objects or state.grips is not self._grips or states is not self._states:
            self._learn_objects(state, states)
        graph = self._kept.get(seen)
        if graph is None:
            still = not state.grips and state.robots.keys().isdisjoint(seen)
            if not still:
                self._learn_robots(state)
            graph = self._make(seen)
            if still:
                self._kept[seen] = graph
        return graph

    def _make(self, seen: tuple[str, ...]) -> SceneGraph:
        numbers = np.array(list(map(self._numbers.__getitem__, seen)), dtype=np.int32)
        node_class, node_state = np.zeros(MAX_NODES, dtype=np.int16), np.zeros(MAX_NODES, dtype=np.int16)
        edges = np.zeros((MAX_EDGES, 3), dtype=np.int16)
        present = describe(numbers, self._packed.words, self._room_classes, node_class, node_state, edges)
        names = (*seen, *[self._rooms[room] for room in present.tolist()])
        return SceneGraph(names, node_class, node_state, edges, self.catalog)

    def _learn_robots(self, state: WorldState) -> None:
        facts = self._facts
        for name, robot in state.robots.items():
            if robot is not self._robots.get(name):
                number = self._numbers[name]
                facts.room[number], facts.position[number] = robot.room, robot.base[0]
        self._robots = state.robots
        for name, grip in state.grips.items():
            facts.room[self._numbers[grip.item]] = state.robots[name].room

    def _learn_objects(self, state: WorldState, states: Mapping[str, str]) -> None:
        facts, objects = self._facts, state.objects
        self._kept.clear()
        before = self._objects.poses
        for name, pose in objects.poses.items():
            if before.get(name) is not pose:
                facts.position[self._numbers[name]] = pose[0]
        if (
            objects.supports is not self._objects.supports
            or state.grips is not self._grips
            or states is not self._states
        ):  # else only what is held has moved
            self._learn_relations(state)
            self._learn_states(state, states)
        self._objects, self._grips, self._states = objects, state.grips, states

    def _learn_relations(self, state: WorldState) -> None:
        facts, objects = self._facts, state.objects
        facts.movable[:], facts.carrier[:] = False, -1
        facts.movable[[self._numbers[name] for name in (*objects.poses, *state.robots)]] = True
        numbers = [self._numbers[name] for name in objects.supports]
        carriers = [self._numbers[support.receptacle] for support in objects.supports.values()]
        facts.carrier[numbers], facts.room[numbers] = carriers, facts.room[carriers]
        facts.relation[numbers] = [_INSIDE if self._is_covered(on) else _ON for on in objects.supports.values()]
        for robot, grip in state.grips.items():
            number = self._numbers[grip.item]
            facts.carrier[number], facts.relation[number] = self._numbers[robot], catalog.RELATION_IDS["held_by"]

    def _learn_states(self, state: WorldState, states: Mapping[str, str]) -> None:
        robots = {name: "holding" if name in state.grips else "free" for name in state.robots}
        known = {**states, **robots, **dict.fromkeys(state.held, "held")}
        self._facts.state[:] = [self.catalog.state_ids[known.get(name, "fixed")] for name in self._numbers]

    def _is_covered(self, support: Support) -> bool:
        return any(abs(height - support.height) < 0.01 for height in self._covered.get(support.receptacle, ()))
