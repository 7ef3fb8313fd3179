"""Tasks of several objects: how they are drawn, what Pick and Place are about, their reward, and the planner."""

import pickle
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from itertools import pairwise, permutations
from typing import Any

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError, TaskError
from chmarl_pb.evaluation.result import load_result
from chmarl_pb.policies.registry import BUILT_IN, make_policy
from chmarl_pb.policies.tidying import Tidying
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.kinds import KINDS, Rearrange, Tidy
from chmarl_pb.tasks.language import parse_instruction, parse_instructions
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.source import draw_solvable
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.targets import is_done, target_of
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import TidyTask, task_of
from chmarl_pb.world import Grip, Objects, RobotState, Support, WorldState

SMALL = Tidy(2, 3)


BAD: tuple[dict[str, Any], ...] = (
    {"id": 5}, {"home": None}, {"seed": -1}, {"seed": "x"}, {"seed": 1.5}, {"optimal_steps": "x"},
)  # fmt: skip


@pytest.mark.parametrize("change", BAD, ids=str)
def test_fields_of_another_kind_are_refused(change: dict[str, Any]) -> None:
    pairs = (("apple", "desk"), ("mug", "bookshelf"))
    task = TidyTask("t", "home_1", tuple(Task("t", "home_1", item, "sofa", target, 0) for item, target in pairs), 0)
    with pytest.raises(TaskError, match="task "):
        replace(task, **change)


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(task=SMALL, split="val-unseen", max_steps=60)
    yield env
    env.close()


@pytest.fixture(scope="module")
def task(simulation_of: Callable[[str], Simulation]) -> TidyTask:
    task = draw_solvable(simulation_of("home_6"), "home_6", np.random.default_rng(4), kind=Tidy(3, 3))
    assert isinstance(task, TidyTask)
    return task


# Rows


def test_a_row_survives_its_file(task: TidyTask) -> None:
    from dataclasses import asdict

    assert task_of(asdict(task)) == task and pickle.loads(pickle.dumps(task)) == task
    assert task_of(asdict(task.moves[0])) == task.moves[0] and task.moves[0].moves == (task.moves[0],)


@pytest.mark.parametrize(
    "change",
    [lambda moves: moves[:1], lambda moves: moves * 2, lambda moves: (moves[0], replace(moves[1], home="home_1"))],
)
def test_rows_that_make_no_sense_are_refused(
    task: TidyTask, change: Callable[[tuple[Task, ...]], tuple[Task, ...]]
) -> None:
    with pytest.raises(TaskError):
        replace(task, moves=change(task.moves))


def test_drawing(simulation_of: Callable[[str], Simulation]) -> None:
    simulation, counts = simulation_of("home_6"), set()
    for seed in range(40):
        task = KINDS["tidy"].sample(simulation.space, "home_6", np.random.default_rng(seed))
        assert isinstance(task, TidyTask)
        counts.add(len(task.moves))
        assert all(move.source != move.target for move in task.moves)
    assert counts == {2, 3, 4, 5}


@pytest.mark.parametrize("numbers", [(1, 2), (3, 2), (2, 6)])
def test_kinds_that_make_no_sense_are_refused(numbers: tuple[int, int]) -> None:
    with pytest.raises(OptionError):
        Tidy(*numbers)


# Pick and Place


def state(*poses: tuple[float, float], held: str = "", done: str = "") -> WorldState:
    """Return a state of objects a_1, b_1, ... at these places, with the humanoid at the origin."""
    names = [f"{letter}_1" for letter in "abc"[: len(poses)]]
    upright = (0.0, 0.0, 0.0, 1.0)
    objects = Objects(
        {name: ((x, y, 0.5), upright) for name, (x, y) in zip(names, poses, strict=True)},
        {name: Support("room/desk_1" if name == done else "room/bed_1", 0.5) for name in names if name != held},
    )
    robot = RobotState(0, 0, 0, ((0.0, 0.0, 0.0), upright))
    return WorldState(objects, {"humanoid": Grip(held, 0.0)} if held else {}, {"humanoid": robot})


GOALS = tuple(Goal(f"{letter}_1", ("room/desk_1",)) for letter in "abc")
ALL = ("a_1", "b_1", "c_1")


@pytest.mark.parametrize(
    ("places", "options", "seen", "meant"),
    [
        ([(3, 0), (0, 2), (4, 0)], {}, ALL, "b_1"),  # the nearest in view
        ([(3, 0), (0, 2), (4, 0)], {}, ("a_1", "c_1"), "a_1"),  # which b is not
        ([(2, 0), (0, 2), (4, 0)], {}, ALL, "a_1"),  # as near, but named first
        ([(3, 0), (0, 2), (4, 0)], {"done": "b_1"}, ALL, "a_1"),  # b is where it belongs
        ([(3, 0), (0, 2), (4, 0)], {"held": "c_1"}, ALL, "c_1"),  # what is held
        ([(3, 0), (0, 2), (4, 0)], {"done": "a_1"}, (), "b_1"),  # nothing in view: the first that is left
    ],
)
def test_what_pick_and_place_are_about(
    places: list[tuple[int, int]], options: dict[str, str], seen: tuple[str, ...], meant: str
) -> None:
    assert target_of(GOALS, state(*places, **options), "humanoid", seen).item == meant


def test_pick_takes_the_nearest_in_view(env: HouseholdEnv) -> None:
    picked = 0
    for seed in range(6):
        env.reset(seed=seed)
        policy, goals = make_policy("planner", env), env.setting.goals

        def check(env: HouseholdEnv, goals: tuple[Goal, ...] = goals, before: list[Any] = []) -> None:  # noqa: B006
            outcome = env.outcome
            if before and outcome.held and not before[-1].held:
                meant = target_of(goals, before[-1].state, "humanoid", before[-1].seen["humanoid"])
                assert outcome.held == meant.item in before[-1].seen["humanoid"]
            before.append(outcome)

        picked += len(chmarl_pb.rollout(env, policy, seed, env.task, on_step=check))
    assert picked


# Potential, instruction and messages


def test_the_reward_adds_up(env: HouseholdEnv) -> None:
    for seed in range(3):
        env.reset(seed=seed)
        episode = chmarl_pb.rollout(env, make_policy("planner", env), seed, env.task)
        count = len(episode.task.moves)
        start = episode.infos[0]["drone"]["potential"]
        assert episode.success and episode.potential == 10 * count
        assert episode.rewards.sum() == 10 * count - start
        assert episode.steps == episode.task.optimal_steps
        assert [part.success for part in env.outcome.parts] == [True] * count


def test_the_instruction_names_all(env: HouseholdEnv) -> None:
    for seed in range(5):
        observations, infos = env.reset(seed=seed)
        assert isinstance(env.task, TidyTask)
        sentences = env.instruction.replace("!", ".").replace("?", ".").split(". ")
        assert [parse_instruction(text) for text in sentences] == [(m.graspable, m.target) for m in env.task.moves]
        assert observations["drone"]["instruction"].shape == (24 * 3,) and 1 not in observations["drone"]["instruction"]
        assert env.observation_space("drone").contains(observations["drone"])
        assert env.state().shape == env.state_space.shape
        assert infos["humanoid"]["instruction"] == env.instruction


def test_messages_tell_of_every_object(env: HouseholdEnv) -> None:
    env.reset(seed=1)
    chmarl_pb.rollout(env, make_policy("planner", env), 1, env.task)
    for goal in env.setting.goals:
        room = env.world.supports[goal.item].receptacle.split("/")[0]
        assert room not in env.rooms or env.messages[1][env.rooms.index(room)]


def test_feedback_is_about_one_of_the_objects(env: HouseholdEnv) -> None:
    env.reset(seed=2)
    known = []
    for actions in chmarl_pb.rollout(env, make_policy("planner", env), 2, env.task).actions:
        known.append(actions)
    env.reset(options={"task": env.task})
    pick, stay = env.action_names["humanoid"].index("pick"), env.action_names["humanoid"].index("stay")
    for actions in known:
        if actions["humanoid"] == pick:
            *_, infos = env.step({**actions, "humanoid": stay})
            assert infos["humanoid"]["feedback"]
            return
        env.step(actions)
    pytest.fail("the planner never picked")


# The planner


def test_no_order_is_shorter(simulation_of: Callable[[str], Simulation], task: TidyTask) -> None:
    simulation = simulation_of("home_6")
    goals = simulation.begin(task, Tidy(3, 3)).goals
    before = simulation.world.state
    best = plan_all(simulation.oracle, goals)
    assert simulation.world.state is before and len(best.actions) == task.optimal_steps
    lengths = {}
    for order in permutations(goals):
        length, failed = 0, False
        simulation.world.state = before
        for goal in order:
            try:
                way = simulation.oracle.plan(goal, goals)
            except TaskError:
                failed = True
                break
            length += len(way)
            for action in way:
                motion = simulation.oracle.robot.plan(action, goal, simulation.renderer.visible("humanoid"))
                assert motion is not None and simulation.oracle.robot.finish(motion)
            assert is_done(goal, simulation.world.state)
        if not failed:
            lengths[order] = length
    simulation.world.state = before
    simulation.world.sync()
    assert lengths[best.goals] == len(best.actions) == min(lengths.values())


def test_the_planner_goes_on_from_anywhere(env: HouseholdEnv) -> None:
    observations, infos = env.reset(seed=3)
    policy, rng = make_policy("planner", env), np.random.default_rng(0)
    policy.reset(3)
    while env.agents:
        actions = policy.act(observations, infos)
        if rng.random() < 0.3:
            actions["humanoid"] = int(rng.integers(env.action_space("humanoid").n))
        observations, *_, infos = env.step(actions)
    assert infos["drone"]["success"]


# Options and results


def test_kinds_do_not_mix(env: HouseholdEnv, task: TidyTask) -> None:
    with pytest.raises(TaskError, match="task='rearrange'"):
        env.reset(options={"task": "val-unseen-000"})
    plain = chmarl_pb.parallel_env(split="val-unseen")
    with pytest.raises(TaskError, match="task='tidy'"):
        plain.reset(options={"task": task})
    plain.close()


@pytest.mark.parametrize("options", [{"task": "cook"}, {"task": Tidy}, {"task": "tidy", "goal": True}])
def test_other_options_are_refused(options: dict[str, Any]) -> None:
    with pytest.raises(OptionError):
        Options(**options)


def test_evaluation(task: TidyTask, tmp_path: Any) -> None:
    given: dict[str, Any] = {"split": "val-unseen", "task": "tidy", "workers": 1, "max_steps": 60}
    report = chmarl_pb.evaluate("planner", tasks=[task], out=tmp_path / "result.json", **given)
    assert (report.success_rate, report.plw) == (1.0, 1.0) and report.settings["options"]["task"] == "tidy"
    assert load_result(tmp_path / "result.json").episodes == report.episodes and report.cooperation is None
    with pytest.raises(TaskError, match="give tasks="):
        chmarl_pb.evaluate("planner", **given)


class Near(Rearrange):
    """A kind of one's own: the paper's tasks, but with a reward for nothing but success."""

    def outcome(self, state: WorldState, setting: Any, seen: dict[str, tuple[str, ...]]) -> Outcome:
        outcome = super().outcome(state, setting, seen)
        return replace(outcome, potential=float(outcome.success))


def test_a_kind_of_ones_own() -> None:
    env = chmarl_pb.parallel_env(task=Near(), split="val-unseen")
    episode = chmarl_pb.rollout(env, make_policy("planner", env), 0, chmarl_pb.load_tasks("val-unseen")[0])
    assert episode.rewards.tolist() == [0.0] * (len(episode) - 1) + [1.0]
    assert all(a["drone"]["potential"] <= b["drone"]["potential"] for a, b in pairwise(episode.infos))
    assert isinstance(episode.task, Task)
    env.close()


def test_an_instruction_of_several_sentences_is_read(env: HouseholdEnv) -> None:
    for seed in range(8):
        env.reset(seed=seed)
        assert parse_instructions(env.instruction) == tuple((move.graspable, move.target) for move in env.task.moves)


def test_the_search_policy_tidies_up_as_far_as_it_can_tell() -> None:
    env = chmarl_pb.parallel_env(split="val-unseen", task="tidy", max_steps=150)
    won = [chmarl_pb.rollout(env, chmarl_pb.make_policy("search", env), seed=seed).success for seed in (0, 1, 3, 8)]
    assert all(won)
    env.close()


@pytest.mark.parametrize("name", sorted(BUILT_IN))
def test_every_policy_plays_tidy_tasks(name: str, env: HouseholdEnv) -> None:
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy(name, env), seed=2)
    assert episode.steps and (episode.success or name != "planner")


def test_what_is_held_is_of_the_goal_whose_object_was_in_view() -> None:
    pairs, tidying = (("mug", "desk"), ("book", "bed"), ("fork", "sofa")), Tidying()
    assert tidying.wanted(pairs, False, frozenset({"book"}), "") == {"mug", "book", "fork"}
    assert tidying.wanted(pairs, True, frozenset({"desk"}), "pick") == {"bed"}
    assert tidying.wanted(pairs, True, frozenset({"bed"}), "turn_left") == {"bed"}
    assert tidying.wanted(pairs, False, frozenset(), "place") == {"mug", "fork"}
    assert tidying.wanted(pairs, False, frozenset({"mug", "fork"}), "turn_left") == {"mug", "fork"}
    assert tidying.wanted(pairs, True, frozenset({"desk"}), "pick") == {"desk"}
    assert tidying.wanted(pairs, True, frozenset({"sofa"}), "place") == {"sofa"}, "it was no mug"


def test_tasks_of_the_other_kind_are_refused_in_one_sentence() -> None:
    one = load_tasks("val-unseen")[:1]
    with pytest.raises(TaskError, match="is of one object; play it in parallel_env"):
        chmarl_pb.evaluate("search", "val-unseen", tasks=one, task="tidy", seeds=[0], workers=1)
    with closing(chmarl_pb.parallel_env(task="tidy", split="val-unseen")) as env:
        env.reset(seed=0)
        several = env.task
    with pytest.raises(TaskError, match="play it in parallel_env"):
        chmarl_pb.evaluate("search", "val-unseen", tasks=[several], seeds=[0], workers=1)
