"""Limited layouts: each class of object has one place in a home, whatever the task."""

from collections import defaultdict
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from chmarl_pb import catalog
from chmarl_pb.data import build_tasks
from chmarl_pb.errors import TaskError
from chmarl_pb.tasks.own_places import own_place
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import LIMITED_SPLITS, SPLIT_SIZES, homes_of, load_tasks
from chmarl_pb.tasks.task import Task


@pytest.fixture
def simulation(simulation_of: Callable[[str], Simulation]) -> Simulation:
    return simulation_of("home_3")


def tasks_in(home: str, split: str, most: int) -> list[Task]:
    return [task for task in load_tasks(split) if task.home == home][:most]


def poses_in(simulation: Simulation, tasks: list[Task]) -> dict[str, set[object]]:
    """Return the poses that each object has in the layouts of some tasks."""
    found: defaultdict[str, set[object]] = defaultdict(set)
    for task in tasks:
        simulation.begin(task)
        for item in simulation.world.objects:
            found[item].add((simulation.world.pose(item), simulation.world.state.objects.supports[item].receptacle))
    return found


def test_each_class_has_one_place_in_a_home(simulation: Simulation) -> None:
    tasks = [task for split in LIMITED_SPLITS for task in tasks_in("home_3", split, 12)]
    limited = poses_in(simulation, tasks)
    assert len(limited) >= 30 and all(len(poses) == 1 for poses in limited.values())
    free = poses_in(simulation, tasks_in("home_3", "train", 36))
    assert np.mean([len(poses) for poses in free.values()]) > 5


def test_a_home_is_dressed_as_ever_and_nothing_touches(simulation: Simulation) -> None:
    for task in tasks_in("home_3", LIMITED_SPLITS[0], 8):
        setting = simulation.begin(task)
        world = simulation.world
        assert len(world.objects) == 19 and setting.goal.item == task.item in world.objects
        for item in world.objects:
            (x, y, z), _ = world.pose(item)
            place = own_place(world, simulation.space, item)
            assert place is not None and place.position == (x, y, z)
            assert not world.taken(np.array([[x, y, z, place.yaw]]), world.size(item), ignoring=[item])[0]


@pytest.mark.parametrize("split", LIMITED_SPLITS)
def test_a_task_begins_where_its_object_lies_and_the_planner_solves_it(simulation: Simulation, split: str) -> None:
    for task in tasks_in("home_3", split, 3):
        simulation.begin(task)
        receptacle = simulation.world.state.objects.supports[task.item].receptacle
        assert catalog.class_of(str(receptacle)) == task.source != task.target
        assert simulation.solve(task).steps == task.optimal_steps


def test_one_source_for_each_object_of_a_home() -> None:
    sources = defaultdict(set)
    for split in LIMITED_SPLITS:
        tasks = load_tasks(split)
        assert len(tasks) == SPLIT_SIZES[split] and {task.home for task in tasks} == set(homes_of("train"))
        for task in tasks:
            sources[task.home, task.graspable].add(task.source)
    assert all(len(classes) == 1 for classes in sources.values())
    assert len(sources) > 200


def test_what_is_validated_and_tested_was_not_trained() -> None:
    train, *others = ({(t.home, t.graspable, t.target) for t in load_tasks(split)} for split in LIMITED_SPLITS)
    for split, kinds in zip(LIMITED_SPLITS[1:], others, strict=True):
        assert len(kinds) == SPLIT_SIZES[split] and not kinds & train
    assert not others[0] & others[1]


def test_a_task_whose_object_lies_elsewhere_is_refused(simulation: Simulation) -> None:
    task = tasks_in("home_3", LIMITED_SPLITS[0], 1)[0]
    source = next(thing for thing in ("bed", "sofa", "desk") if thing not in (task.source, task.target))
    with pytest.raises(TaskError, match=f"no {source} of home_3 has a reachable place"):
        simulation.begin(replace(task, source=source))


def test_the_same_tasks_are_drawn_again() -> None:
    """Not more than the first, which never gives way to another."""
    assert build_tasks._solve_slot(("test-limited", 0, 0)) == (0, load_tasks("test-limited")[0])


def test_places_do_not_depend_on_what_stands_there(simulation: Simulation) -> None:
    tasks = tasks_in("home_3", LIMITED_SPLITS[0], 2)
    simulation.begin(tasks[0])
    first = {item: own_place(simulation.world, simulation.space, item) for item in simulation.world.objects}
    simulation.begin(tasks[1])
    assert first == {item: own_place(simulation.world, simulation.space, item) for item in first}
