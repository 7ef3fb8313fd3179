"""A kind of tasks of one's own that has another goal beside the one that the task names."""

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import pytest

import chmarl_pb
from chmarl_pb.errors import TaskError
from chmarl_pb.evaluation.optimum import optimal_steps
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.tasks.kinds import Rearrange
from chmarl_pb.tasks.outcome import Outcome, outcome_of
from chmarl_pb.tasks.setting import set_up
from chmarl_pb.tasks.splits import find_task
from chmarl_pb.tasks.task import Task

IDS = [f"val-unseen-{number:03d}" for number in (3, 4, 7)]


@dataclass(frozen=True)
class Swap(Rearrange):
    """X is to be brought to Y, and a book or a mug from Y to where X was."""

    objects: ClassVar[int] = 2

    def moves(self, task: Any) -> tuple[Task, Task]:
        other = "mug" if task.graspable == "book" else "book"
        return task, Task(f"{task.id}.back", task.home, other, task.target, task.source, task.seed)

    def set_up(self, world: Any, space: Any, task: Any) -> Any:
        return set_up(world, space, task, self.moves(task))

    def outcome(self, state: Any, setting: Any, seen: Any) -> Outcome:
        parts = tuple(outcome_of(state, goal, seen, setting.graspers, setting.rooms) for goal in setting.goals)
        phi, success = sum(part.potential for part in parts), all(part.success for part in parts)
        return Outcome(state, seen, parts[0].item_room, phi, success, parts)

    def instruction(self, task: Any) -> str:
        return " ".join(super(Swap, self).instruction(move) for move in self.moves(task))


class Polite(Rearrange):
    """The benchmark's kind, with another sentence."""

    def instruction(self, task: Any) -> str:
        return f"Please bring the {task.graspable} to the {task.target}."


@pytest.fixture(scope="module")
def swapping() -> Iterator[Any]:
    with closing(chmarl_pb.parallel_env(split="val-unseen", task=Swap(), max_steps=60)) as env:
        yield env


def test_layouts_of_the_benchmark_stay_as_they_are(swapping: Any) -> None:
    def begun(env: Any) -> list[str]:
        hashes = []
        for task in IDS:
            env.reset(seed=0, options={"task": task})
            hashes.append(state_hash(env))
        return hashes

    with closing(chmarl_pb.parallel_env(split="val-unseen")) as env:
        before = begun(env)
        others = begun(swapping)
        assert begun(env) == before
        assert begun(swapping) == others
        assert not set(before) & set(others)


@pytest.mark.parametrize("feedback", [True, "planner"])
def test_feedback_about_a_goal_that_the_task_does_not_name(feedback: Any) -> None:
    said = set()
    with closing(chmarl_pb.parallel_env(split="val-unseen", task=Swap(), feedback=feedback, max_steps=60)) as env:
        for task in IDS:
            _, infos = env.reset(seed=0, options={"task": task})
            while env.agents:
                # brings the book or the mug up to the last action, which it does not take
                way = env.simulation.oracle.plan(env.setting.goals[1])
                wanted = env.action_names["humanoid"].index(way[0] if len(way) > 1 else "stay")
                _, _, _, _, infos = env.step({"humanoid": wanted, "drone": 8})
                said.add(infos["humanoid"]["feedback"])
    assert said - {""}


def test_the_fewest_steps_are_those_of_all_goals(swapping: Any) -> None:
    result = chmarl_pb.evaluate("planner", "val-unseen", tasks=IDS, task=Swap(), max_steps=60, workers=1)
    assert result.success_rate == 1
    assert result.plw == 1
    for episode in result.episodes:
        assert episode.optimal_steps == episode.steps > episode.task.optimal_steps
        assert optimal_steps(swapping, episode.task) == episode.steps


def test_a_kind_with_the_benchmarks_goals_has_its_fewest_steps() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen", task=Polite())) as env:
        for task in map(find_task, IDS):
            assert optimal_steps(env, task) == task.optimal_steps


class Fetch(Rearrange):
    """Success is to hold X."""

    def outcome(self, state: Any, setting: Any, seen: Any) -> Outcome:
        given = super().outcome(state, setting, seen)
        return replace(given, success=given.held is not None)


def test_the_fewest_steps_of_a_kind_with_another_success_end_there() -> None:
    result = chmarl_pb.evaluate("planner", "val-unseen", tasks=IDS, task=Fetch(), workers=1)
    assert result.success_rate == 1 and result.plw == 1
    for episode in result.episodes:
        assert episode.steps < episode.task.optimal_steps
        assert episode.optimum is not None and not episode.optimum.proven, "nothing shows that there is no shorter way"


@dataclass(frozen=True)
class Elsewhere(Rearrange):
    """The benchmark's kind, but things stand elsewhere."""

    def set_up(self, world: Any, space: Any, task: Any) -> Any:
        return replace(super().set_up(world, space, replace(task, seed=task.seed + 5)), task=task)


def test_the_fewest_steps_of_a_kind_with_another_layout_are_planned_there() -> None:
    result = chmarl_pb.evaluate("planner", "val-unseen", tasks=IDS, task=Elsewhere(), workers=1)
    assert result.plw == 1 and {episode.optimum is not None for episode in result.episodes} == {True}


def test_a_goal_that_is_nowhere() -> None:
    class Lost(Swap):
        def set_up(self, world: Any, space: Any, task: Any) -> Any:
            setting = super().set_up(world, space, task)
            world.arrange(type(world.state.objects)({}, {}))
            return setting

    with (
        closing(chmarl_pb.parallel_env(split="val-unseen", task=Lost())) as env,
        pytest.raises(TaskError, match="is nowhere in the home; lay out every object that is a goal"),
    ):
        env.reset(options={"task": IDS[0]})
