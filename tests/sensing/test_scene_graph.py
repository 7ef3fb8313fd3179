"""The scene graph tells what is seen, how it is and where it is, and fits its arrays."""

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.sensing.scene_graph import MAX_EDGES, MAX_NODES, SceneGraph
from chmarl_pb.tasks.setting import Setting
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.task import Task


@pytest.fixture
def begun(simulation: Simulation, tasks: list[Task]) -> tuple[Simulation, Setting]:
    return simulation, simulation.begin(next(task for task in tasks if task.home == simulation.home.name))


def everything(simulation: Simulation) -> tuple[str, ...]:
    """Return the names of all nodes that there can be, but the drone."""
    return tuple(name for name in simulation.renderer.names if name in set(nodes(simulation)) - {"drone"})


def nodes(simulation: Simulation) -> list[str]:
    things = [thing.name for thing in simulation.home.things if thing.class_name in catalog.BENCHMARK.classes]
    return [*things, *simulation.world.objects, "humanoid", "drone"]


def graph_of(simulation: Simulation, setting: Setting, seen: tuple[str, ...]) -> SceneGraph:
    return simulation.graphs.graph(simulation.world.state, seen, setting.states)


def relations(graph: SceneGraph, name: str, relation: str) -> list[str]:
    return [target for source, target, kind in graph.relations() if source == name and kind == relation]


def test_whole_home_fits(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    graph = graph_of(simulation, setting, everything(simulation))
    arrays = graph.arrays()
    assert len(graph.names) <= MAX_NODES
    assert (arrays["node_class"] > 0).sum() == (arrays["node_state"] > 0).sum() == len(graph.names)
    assert (arrays["edges"][:, 2] > 0).sum() == len(list(graph.relations())) < MAX_EDGES
    assert len(set(graph.names)) == len(graph.names)


def test_arrays_spell_the_graph(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    graph = graph_of(simulation, setting, everything(simulation))
    arrays = graph.arrays()
    for number, name in enumerate(graph.names):
        assert arrays["node_class"][number] == catalog.BENCHMARK.class_ids[catalog.class_of(name)]
        assert arrays["node_state"][number] == catalog.BENCHMARK.state_ids[graph.states[number]]
    for row, (source, target, kind) in enumerate(graph.relations()):
        nodes = graph.names.index(source), graph.names.index(target)
        assert arrays["edges"][row].tolist() == [*nodes, catalog.RELATION_IDS[kind]]


def test_objects_are_on_or_inside_what_carries_them(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    graph = graph_of(simulation, setting, everything(simulation))
    for item, support in simulation.world.supports.items():
        carried = relations(graph, item, "on") + relations(graph, item, "inside")
        assert carried == [support.receptacle]
        assert relations(graph, item, "in_room") == [catalog.room_of(support.receptacle)]


def test_covered_means_inside(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    graph = graph_of(simulation, setting, everything(simulation))
    for item, support in simulation.world.supports.items():
        x, y, z = simulation.world.pose(item)[0]
        above = [
            solid
            for solid in simulation.home.receptacles[support.receptacle].solids
            if solid.bottom > z + 0.1 and (solid.low < (x, y)).all() and (solid.high > (x, y)).all()
        ]
        if not above and relations(graph, item, "inside"):
            # The surface is covered in part, but not over this object.
            assert any(s.covered for s in simulation.space.surfaces if s.receptacle == support.receptacle)
        if above:
            assert relations(graph, item, "inside") == [support.receptacle]


def test_states_are_the_settings(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    graph = graph_of(simulation, setting, everything(simulation))
    for name, state in zip(graph.names, graph.states, strict=True):
        assert state in catalog.BENCHMARK.classes[catalog.class_of(name)].states
        if name in setting.states:
            assert state == setting.states[name]


def test_held_object(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    item = setting.goal.item
    simulation.oracle.robot.hold(item)
    graph = graph_of(simulation, setting, ("humanoid", item))
    assert graph.states[graph.names.index(item)] == "held"
    assert graph.states[graph.names.index("humanoid")] == "holding"
    assert relations(graph, item, "held_by") == ["humanoid"]
    room = list(simulation.home.rooms)[simulation.world.robots["humanoid"].room]
    assert relations(graph, item, "in_room") == relations(graph, "humanoid", "in_room") == [room]
    alone = graph_of(simulation, setting, (item,))
    assert relations(alone, item, "held_by") == [] and relations(alone, item, "in_room") == [room]


def test_near_is_short_and_symmetric_enough(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    graph = graph_of(simulation, setting, everything(simulation))
    count = dict.fromkeys(graph.names, 0)
    for a, b, kind in graph.relations():
        if kind == "near":
            first, second = (np.array(simulation.world.robots[n].base[0] if n == "humanoid" else
                                      simulation.world.pose(n)[0]) for n in (a, b))  # fmt: skip
            assert a != b and np.linalg.norm(first - second) < 0.75
            count[a] += 1
    assert max(count.values()) <= 4


def test_only_what_is_seen_is_told(begun: tuple[Simulation, Setting]) -> None:
    simulation, setting = begun
    seen = simulation.renderer.visible("drone")
    graph = graph_of(simulation, setting, seen)
    rooms = set(graph.names) - set(seen)
    assert graph.names[: len(seen)] == seen and rooms <= set(simulation.home.rooms)
    assert graph_of(simulation, setting, ()).names == ()
