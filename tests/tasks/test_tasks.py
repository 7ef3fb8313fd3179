"""The benchmark's tasks: files, refusals, and the home that a task's seed lays out."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pybullet
import pytest

from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import TaskError
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.solids import inside
from chmarl_pb.tasks.sampling import sample_task
from chmarl_pb.tasks.setting import draw_starts, receptacles_of
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import (
    BENCHMARK_SPLITS,
    FIELDS,
    FOLDER,
    LIMITED_SPLITS,
    SPLIT_SIZES,
    SPLITS,
    STREAM,
    find_task,
    homes_of,
    load_tasks,
    read_tasks,
    split_of,
)
from chmarl_pb.tasks.task import Task
from chmarl_pb.world import Pose, Support
from tests.helpers.small_homes import HOMES

GOOD: dict[str, Any] = dict(
    id="t-1", home="home_1", graspable="mug", source="bed", target="desk", seed=3, optimal_steps=5
)
HEADER = ",".join(FIELDS)


def test_splits_of_the_benchmark() -> None:
    assert BENCHMARK_SPLITS == ("train", "val-seen", "val-unseen", "test-seen", "test-unseen")
    assert (*BENCHMARK_SPLITS, "generated-val", "generated-test", "generated", *LIMITED_SPLITS) == SPLITS
    assert list(SPLIT_SIZES.values()) == [5500, 250, 50, 250, 50, 500, 2000, 5500, 250, 250]
    seen = {home for split in BENCHMARK_SPLITS if not split.endswith("unseen") for home in homes_of(split)}
    assert seen == set(HOMES[:5])
    assert (homes_of("val-unseen"), homes_of("test-unseen")) == (("home_6",), ("home_7",))


@pytest.mark.parametrize("split", SPLIT_SIZES)
def test_task_file(split: str) -> None:
    tasks = load_tasks(split)
    assert 0 < len(tasks) <= SPLIT_SIZES[split]
    assert {task.home for task in tasks} == set(homes_of(split))
    assert [task.id.rpartition("-")[0] for task in tasks] == [split] * len(tasks)
    assert [int(task.id.rpartition("-")[2]) for task in tasks] == list(range(len(tasks)))
    assert all(task.optimal_steps >= 2 for task in tasks)
    assert find_task(tasks[-1].id) == tasks[-1]
    counts = [sum(task.home == home for task in tasks) for home in homes_of(split)]
    assert max(counts) - min(counts) <= 1


def test_no_task_stands_twice() -> None:
    tasks = [task for split in SPLITS for task in load_tasks(split)]
    assert len({task.id for task in tasks}) == len(tasks)
    tasks = [task for split in SPLITS if split not in LIMITED_SPLITS for task in load_tasks(split)]
    assert len({(task.home, task.graspable, task.source, task.target) for task in tasks}) == len(tasks)


def test_tasks_name_receptacles_of_their_homes() -> None:
    classes = {home: {thing.class_name for thing in load_home(home).receptacles.values()} for home in HOMES}
    for split in BENCHMARK_SPLITS:
        for task in load_tasks(split):
            assert {task.source, task.target} <= classes[task.home], task


def test_loading_hands_out_a_list_of_one_s_own() -> None:
    load_tasks("train").clear()
    assert load_tasks("train")


@pytest.mark.parametrize("split", ["Train", "", "test", "test_unseen"])
def test_unknown_split(split: str) -> None:
    with pytest.raises(TaskError, match=r"unknown split.*train, val-seen"):
        load_tasks(split)


@pytest.mark.parametrize("task_id", ["train-99999", "nosuch-001", "", "train", "../train-0001"])
def test_unknown_task(task_id: str) -> None:
    with pytest.raises(TaskError, match="unknown task"):
        find_task(task_id)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"graspable": "unicorn"}, "unknown graspable 'unicorn'"),
        ({"graspable": "bed"}, "unknown graspable"),
        ({"source": "mug"}, "unknown receptacle 'mug'"),
        ({"target": "fridge"}, "unknown receptacle 'fridge'"),
        ({"target": "bed"}, "source and target"),
        ({"seed": -1}, "negative"),
    ],
)
def test_bad_task(change: dict[str, Any], words: str) -> None:
    with pytest.raises(TaskError, match=f"task 't-1'.*{words}"):
        Task(**{**GOOD, **change}).check(BENCHMARK)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "first line"),
        ("id,home\n", "first line"),
        (f"{HEADER}\nt-1,home_1,unicorn,bed,desk,3,5\n", "line 2.*unicorn"),
        (f"{HEADER}\nt-1,home_1,mug,bed,desk,3,5\nt-2,home_1,mug,bed,desk,x,5\n", "line 3"),
        (f"{HEADER}\nt-1,home_1,mug,bed\n", "line 2"),
        (f"{HEADER}\nt-1,home_1,mug,bed,desk,3,5,surplus\n", "line 2"),
        (f"{HEADER}\nt-1,home_1,mug,bed,desk,3,\n", "line 2"),
    ],
)
def test_damaged_file(tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "tasks.csv"
    path.write_text(text)
    with pytest.raises(TaskError, match=rf"tasks\.csv.*{words}"):
        read_tasks(path)


def test_a_file_that_is_no_text(tmp_path: Path) -> None:
    path = tmp_path / "tasks.csv"
    path.write_bytes(HEADER.encode() + b"\n\xff\xfe\n")
    with pytest.raises(TaskError, match=r"tasks\.csv: not a text in UTF-8"):
        read_tasks(path)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(TaskError, match="no such task file"):
        read_tasks(tmp_path / "tasks.csv")


@pytest.mark.parametrize(("home", "missing"), [("home_3", "bench"), ("home_4", "desk")])
def test_a_task_whose_home_lacks_its_receptacle(
    simulation_of: Callable[[str], Simulation], home: str, missing: str
) -> None:
    simulation = simulation_of(home)
    for role in ({"source": missing, "target": "bed"}, {"source": "bed", "target": missing}):
        with pytest.raises(TaskError, match=f"{home} has no {missing}"):
            simulation.begin(Task(**{**GOOD, **role}))


def test_a_task_whose_object_is_too_large_for_its_target(simulation: Simulation) -> None:
    with pytest.raises(TaskError, match=r"'t-1': board_game_1 is too large for \w+/nightstand_1"):
        simulation.begin(Task(**{**GOOD, "graspable": "board_game", "target": "nightstand"}))


def test_sampled_tasks_are_spread_and_repeat_with_the_seed(simulation: Simulation) -> None:
    def draw(seed: int) -> list[Task]:
        rng = np.random.default_rng(seed)
        return [sample_task(simulation.space, simulation.home.name, rng) for _ in range(300)]

    assert draw(1) == draw(1) != draw(2)
    tasks = draw(3)
    assert len({task.id for task in tasks}) == 300
    assert len({task.graspable for task in tasks}) == 45
    classes = {thing.class_name for thing in simulation.home.receptacles.values()}
    assert {task.source for task in tasks} == {task.target for task in tasks} == classes


def layout(simulation: Simulation) -> dict[str, tuple[Pose, Support]]:
    return {name: (simulation.world.pose(name), simulation.world.supports[name]) for name in simulation.world.objects}


def test_set_up_is_the_seeds_alone(simulation: Simulation, tasks: list[Task]) -> None:
    first, second = [task for task in tasks if task.home == simulation.home.name][:2]
    setting, before = simulation.begin(first), layout(simulation)
    other = simulation.begin(second)
    assert layout(simulation) != before and other != setting
    simulation.oracle.robot.hold(second.item)
    assert simulation.begin(first) == setting and layout(simulation) == before
    assert simulation.world.held is None


def test_home_is_dressed(simulation: Simulation, tasks: list[Task]) -> None:
    for task in [task for task in tasks if task.home == simulation.home.name][:6]:
        setting = simulation.begin(task)
        objects = simulation.world.objects
        assert task.item in objects and len(objects) - 1 >= 15
        classes = [catalog.class_of(name) for name in objects]
        assert len(set(classes)) == len(classes)
        assert setting.goal.item == task.item and setting.goal.receptacles == receptacles_of(
            simulation.home, task.target
        )
        source = simulation.world.supports[task.item].receptacle
        assert catalog.class_of(source) == task.source


def touches(simulation: Simulation, item: str) -> set[str]:
    """Return what an object touches within a millimetre: the home's things and other objects."""
    client, names = simulation.world.client, {link: name for name, link in simulation.world.links.items()}
    bodies = {body: name for name, body in simulation.world.bodies.items()}
    body = simulation.world.bodies[item]
    found = set()
    for other, name in bodies.items():
        if other != body:
            for contact in pybullet.getClosestPoints(body, other, 1e-3, physicsClientId=client):
                found.add(names[contact[4]] if name == "home" else name)
    return found - {"humanoid", "drone"}


def test_objects_rest_on_what_carries_them_by_contact(simulation: Simulation, tasks: list[Task]) -> None:
    task = next(task for task in tasks if task.home == simulation.home.name)
    simulation.begin(task)
    world, physics = simulation.world, simulation.world.physics
    world.sync()
    for item in world.objects:
        assert touches(simulation, item) == {world.supports[item].receptacle}, item
    (x, y, z), _ = world.pose(task.item)
    physics.thaw(task.item)
    for _ in range(120):
        physics.step()
    assert physics.rests_on(task.item, world.supports[task.item].receptacle)
    moved = np.subtract(physics.read_object(task.item)[0], (x, y, z))
    assert np.abs(moved).max() < 0.01, f"{task.item} does not rest where it was put: {moved}"
    physics.freeze(task.item)
    world.moved()


def test_everything_is_inside_the_home(simulation: Simulation, tasks: list[Task]) -> None:
    floors = [floor for room in simulation.home.rooms.values() for floor in room.floors]
    for task in [task for task in tasks if task.home == simulation.home.name][:4]:
        setting = simulation.begin(task)
        for item in simulation.world.objects:
            (x, y, z), _ = simulation.world.pose(item)
            assert any(inside(floor, np.array([x, y])) for floor in floors) and 0.2 < z < 1.6
        starts = draw_starts(task.seed, (simulation.space.lattice, simulation.space.drone_lattice))
        assert tuple(robot.pose for robot in simulation.robots.values()) == starts
        assert set(setting.states) == {thing.name for thing in simulation.home.things} | set(simulation.world.objects)


def test_task_files_are_those_of_the_release() -> None:
    for line in (FOLDER / "SHA256SUMS").read_text().splitlines():
        digest, name = line.split()
        assert hashlib.sha256((FOLDER / name).read_bytes()).hexdigest() == digest, f"{name} has changed"
    assert {split: len(load_tasks(split)) for split in SPLITS} == SPLIT_SIZES | {STREAM: 0}
    named = {line.split()[1] for line in (FOLDER / "SHA256SUMS").read_text().splitlines()}
    assert named == {path.name for path in FOLDER.iterdir()} - {"SHA256SUMS"}


def test_a_drawn_task_is_of_no_split_whatever_its_home_is_called() -> None:
    assert split_of("test-seen-017") == "test-seen" and split_of("train-5499") == "train"
    assert split_of("test-seen-1234567") is split_of("train-limited-x") is split_of("cabin-3") is None
