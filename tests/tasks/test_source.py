"""Which task an episode plays: of the split, of the only home, or one that is made up for a home."""

from collections.abc import Callable

import numpy as np
import pytest

from chmarl_pb.errors import TaskError
from chmarl_pb.tasks.kinds import REARRANGE
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.source import TaskSource, draw_solvable
from chmarl_pb.tasks.splits import homes_of, load_tasks
from chmarl_pb.tasks.task import Task


def no_simulation(home: str) -> Simulation:
    raise AssertionError(f"asks for {home}, though the split has tasks")


@pytest.mark.parametrize("split", ["val-unseen", "test-seen"])
def test_a_split_without_a_home_plays_its_own_tasks_all_of_them(split: str) -> None:
    source, rng, tasks = TaskSource(split, None, REARRANGE), np.random.default_rng(0), load_tasks(split)
    drawn = {source.draw(rng, no_simulation).id for _ in range(40 * len(tasks))}
    assert drawn == {task.id for task in tasks}, f"{len(drawn)} of {len(tasks)} tasks come up"


def test_draws_repeat_with_the_seed_and_differ_with_another() -> None:
    source = TaskSource("val-unseen", None, REARRANGE)

    def ids(seed: int) -> list[str]:
        rng = np.random.default_rng(seed)
        return [source.draw(rng, no_simulation).id for _ in range(10)]

    assert ids(1) == ids(1), "the same seed draws other tasks"
    assert ids(1) != ids(2), "another seed draws the same tasks"


def test_a_home_of_the_split_plays_the_split_s_tasks_of_that_home() -> None:
    home = homes_of("val-unseen")[0]
    source, rng = TaskSource("val-unseen", home, REARRANGE), np.random.default_rng(0)
    known = {task.id for task in load_tasks("val-unseen")}
    drawn = [source.draw(rng, no_simulation) for _ in range(50)]
    assert {task.home for task in drawn} == {home}, "it plays in other homes"
    assert {task.id for task in drawn} <= known, "it makes up tasks, though the split has some for that home"


def test_another_home_plays_tasks_made_up_for_it_that_the_planner_solves(
    simulation_of: Callable[[str], Simulation],
) -> None:
    source = TaskSource("val-unseen", "home_1", REARRANGE)  # a home of training
    first, again = (source.draw(np.random.default_rng(4), simulation_of) for _ in range(2))
    assert first == again, "the same seed makes up another task"
    assert first.home == "home_1" and first.id not in {task.id for task in load_tasks("train")}
    simulation = simulation_of("home_1")
    assert (
        first.optimal_steps == max(len(plan.actions) for plan in simulation.solve(first, REARRANGE).plans.values()) > 0
    )


def test_tasks_by_name() -> None:
    source = TaskSource("val-unseen", None, REARRANGE)
    task = load_tasks("test-seen")[3]  # also one of another split
    assert source.named(task.id) == task and source.named(task) is task
    with pytest.raises(TaskError, match="no-such-task"):
        source.named("no-such-task")
    with pytest.raises(TaskError, match="got int; give a Task, its fields or its id"):
        source.named(3)  # type: ignore[arg-type]


def test_a_home_without_solvable_tasks_is_named_with_the_reason(
    simulation_of: Callable[[str], Simulation], monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = simulation_of("home_1")

    def unsolvable(task: Task, kind: object) -> list[str]:
        raise TaskError("the bed cannot be reached")

    monkeypatch.setattr(simulation, "solve", unsolvable)
    with pytest.raises(TaskError, match=r"home_1.*none of 100 drawn tasks.*the bed cannot be reached"):
        draw_solvable(simulation, "home_1", np.random.default_rng(0))
