"""Lookalikes: other objects of X's class in other colours, and the room of Y where that class is not unique."""

import copy
from collections import Counter
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.catalog import COLOUR_IDS, COLOURS
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError, TaskError
from chmarl_pb.evaluation.episode_file import load_episode, record_episode, replay_episode, save_episode
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.robots.pointing import cell_of
from chmarl_pb.tasks import language
from chmarl_pb.tasks.kinds import Rearrange
from chmarl_pb.tasks.lookalike_task import LookalikeTask
from chmarl_pb.tasks.order import TeamPlan, plan_team
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import load_tasks
from tests.helpers.playing import play

TASKS = load_tasks("val-unseen")[::5]


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", lookalikes=True, pointing=True, goal=True)
    yield env
    env.close()


def definite(env: HouseholdEnv) -> LookalikeTask:
    """Return what the environment's task has become."""
    task = env.setting.task
    assert isinstance(task, LookalikeTask)
    return task


def test_one_to_three_lookalikes_stand_in_the_home(env: HouseholdEnv) -> None:
    counts = set()
    for task in TASKS:
        env.reset(options={"task": task})
        alike = [name for name in env.world.objects if catalog.class_of(name) == task.graspable]
        assert set(alike) == {definite(env).item, *definite(env).lookalikes}
        counts.add(len(alike) - 1)
        assert env.setting.goal.item == catalog.object_name(task.graspable, definite(env).colour)
        assert len(env.world.objects) <= 19
        others = Counter(catalog.class_of(name) for name in env.world.objects if name not in alike)
        assert 2 <= sum(count > 1 for count in others.values()) <= 3, "X's class is not known by its number"
        assert max(others.values()) <= 4
        assert env.task == task and env.setting.task.id == task.id
    assert counts == {1, 2, 3}


def test_instructions_name_the_colour_and_the_room_where_it_is_needed(env: HouseholdEnv) -> None:
    rooms = 0
    for task in TASKS:
        env.reset(options={"task": task})
        x, y = env.setting.goal.item, env.setting.goal.receptacles
        assert language.parse_instruction(env.instruction) == (task.graspable, task.target)
        of_class = [name for name, thing in env.simulation.home.receptacles.items() if thing.class_name == task.target]
        tokens = language.tokenize(env.instruction, 32, attributes=True)
        asked = language.read_attributes(tokens)
        assert asked[task.graspable] == COLOURS[catalog.colour_of(x) - 1] == definite(env).colour
        assert (task.target in asked) == (len(of_class) > 1)
        assert asked.get(task.target, "") == definite(env).room
        if len(of_class) > 1:
            rooms += 1
            assert set(y) == {name for name in of_class if catalog.room_of(name) == asked[task.target]}
        else:
            assert list(y) == of_class
    assert rooms


def test_the_observation_tells_colours_and_stays_as_it_is_without_them(env: HouseholdEnv) -> None:
    observations, infos = env.reset(options={"task": TASKS[0]})
    space = env.observation_space("humanoid")
    for robot, seen in observations.items():
        assert space.contains(seen)
        for name, node, colour in zip(infos[robot]["visible"], seen["node_class"], seen["node_color"], strict=False):
            assert env.catalog.rows[node - 1].name == (robot and catalog.class_of(name))
            assert colour == (catalog.colour_of(name) if "/" not in name and name not in env.possible_agents else 0)
    plain, pictures = chmarl_pb.parallel_env(goal=True), chmarl_pb.parallel_env("visual", lookalikes=True)
    own = plain.observation_space("drone")
    words = own["instruction"]
    assert isinstance(words, spaces.Box)
    assert words.shape == (24,) and words.high[0] == language.vocabulary_size() - 1
    assert not {"node_color", "goal_attributes"} & set(own.spaces)
    assert "node_color" not in pictures.observation_space("drone").spaces
    plain.close()
    pictures.close()


def test_goals_are_exact(env: HouseholdEnv) -> None:
    seen_other = False
    for task in TASKS:
        observations, infos = env.reset(options={"task": task})
        for robot, seen in observations.items():
            x, y = env.setting.goal.item, set(env.setting.goal.receptacles)
            visible = set(infos[robot]["visible"])
            assert seen["goal"].tolist()[2:] == [x in visible, not y.isdisjoint(visible)]
            seen_other |= not seen["goal"][2] and not visible.isdisjoint(definite(env).lookalikes)
            colour, room = seen["goal_attributes"].tolist()
            assert colour == COLOUR_IDS[definite(env).colour]
            assert ("", *env.rooms)[room] == definite(env).room
    assert seen_other


def test_a_lookalike_is_no_success(env: HouseholdEnv) -> None:
    for task in TASKS:
        env.reset(options={"task": task})
        goal, lookalike = env.setting.goal, definite(env).lookalikes[0]
        before = env.world.state
        place = env.world.pose(lookalike)[0]
        env.world.place(lookalike, place, (0.0, 0.0, 0.0, 1.0), goal.receptacles[0])
        assert not env._kind.outcome(env.world.state, env.setting, env.outcome.seen).success
        env.world.place(goal.item, place, (0.0, 0.0, 0.0, 1.0), goal.receptacles[0])
        assert env._kind.outcome(env.world.state, env.setting, env.outcome.seen).success
        elsewhere = [
            name for name, thing in env.simulation.home.receptacles.items()
            if thing.class_name == task.target and name not in goal.receptacles
        ]  # fmt: skip
        for name in elsewhere:
            env.world.place(goal.item, place, (0.0, 0.0, 0.0, 1.0), name)
            assert not env._kind.outcome(env.world.state, env.setting, env.outcome.seen).success
        env.world.state = before


@pytest.mark.parametrize("name", ["search", "belief", "planner"])
def test_policies_that_read_pick_x_and_not_a_lookalike(env: HouseholdEnv, name: str) -> None:
    policy, picks, solved = make_policy(name, env), 0, 0
    for task in TASKS[:6]:
        held: list[str] = []

        def note(env: HouseholdEnv, held: list[str] = held) -> None:
            held += [grip.item for grip in env.world.state.grips.values()]

        episode = chmarl_pb.rollout(env, policy, 0, task, note)
        picks += bool(held)
        solved += episode.success
        alike = [item for item in held if catalog.class_of(item) == task.graspable]
        assert set(alike) <= {env.setting.goal.item}
    assert picks >= 4 and solved >= 3


def test_pick_takes_the_lookalike_that_is_pointed_at(env: HouseholdEnv) -> None:
    for task in TASKS:
        env.reset(options={"task": task})
        pointer, simulation = env.simulation.pointer, env.simulation
        assert pointer is not None
        wrong = definite(env).lookalikes[0]
        for pose in range(0, simulation.oracle.robot.lattice.count, 7):
            if wrong not in simulation.oracle.seen_from("humanoid", pose):
                continue
            simulation.robots["humanoid"].spawn(pose)
            env.outcome = env._look()
            action = next((action for action, thing in pointer.shown("humanoid", "pick").items() if thing == wrong), "")
            if action:
                assert cell_of(action) is not None
                names = env.action_names
                env.step({"humanoid": names["humanoid"].index(action), "drone": names["drone"].index("stay")})
                if env.world.held == wrong:
                    return
    raise AssertionError("no lookalike could be picked")


def test_without_pointing_pick_acts_on_x() -> None:
    env = chmarl_pb.parallel_env(split="val-unseen", lookalikes=True)
    report = chmarl_pb.rollout(env, make_policy("planner", env), 0, TASKS[0])
    assert report.success and len(report) == env.simulation.solve(env.task).steps
    env.close()


def test_equal_seeds_give_equal_episodes_and_copies() -> None:
    env = chmarl_pb.parallel_env(split="generated-val", lookalikes=True)
    twin = copy.deepcopy(env)
    assert play(env, 3, 6) == play(twin, 3, 6)
    assert env.setting.task == twin.setting.task and env.instruction == env.instruction_of(env.task)
    twin.close()
    env.close()


def test_gymnasium_and_vectors_take_it() -> None:
    for env_id in ("CHMARL/SceneGraph-v0", "CHMARL/VisualHumanoid-v0"):
        env = gymnasium.make(env_id, lookalikes=True, split="val-unseen")
        observation, _ = env.reset(seed=0)
        assert env.observation_space.contains(observation)
        env.close()
    vector = chmarl_pb.vector_env(2, workers=0, lookalikes=True, split="val-unseen")
    observations, _ = vector.reset(seed=0)
    assert observations["humanoid_node_color"].shape == (2, 96)
    vector.close()


def test_episode_files_and_results_keep_it(env: HouseholdEnv, tmp_path: Path) -> None:
    plain = chmarl_pb.parallel_env(split="val-unseen", lookalikes=True)
    file = record_episode(plain, make_policy("planner", plain), "planner", 0, TASKS[1])
    plain.close()
    save_episode(file, tmp_path / "episode.json")
    again = load_episode(tmp_path / "episode.json")
    assert again.options["lookalikes"] is True and again.success and replay_episode(again) is None
    report = chmarl_pb.evaluate("planner", "val-unseen", tasks=TASKS[:2], workers=1, lookalikes=True, seeds=(0,))
    assert report.settings["options"]["lookalikes"] is True and report.changed == "lookalikes"
    assert report.plw == 1.0


def test_text_tells_the_colours() -> None:
    env = chmarl_pb.parallel_env("text", split="val-unseen", lookalikes=True)
    colours = set[str]()
    for task in TASKS[:3]:
        _, infos = env.reset(options={"task": task})
        for robot in env.possible_agents:
            for name in infos[robot]["visible"]:
                if "/" not in name and name not in env.possible_agents:
                    words = f"{COLOURS[catalog.colour_of(name) - 1]} {catalog.class_of(name).replace('_', ' ')}"
                    assert words in infos[robot]["text"]
                    colours.add(words)
    assert colours
    env.close()


def test_what_does_not_go_together_is_refused() -> None:
    with pytest.raises(OptionError, match="lookalikes=2 is not known"):
        chmarl_pb.parallel_env(lookalikes=2)
    with pytest.raises(OptionError, match="lookalikes=True needs tasks that name one object"):
        chmarl_pb.parallel_env(task="tidy", lookalikes=True)
    task = LookalikeTask("a", "home_1", "mug", "desk", "bed", 1, colour="red")
    env = chmarl_pb.parallel_env()
    with pytest.raises(TaskError, match="lookalikes=True"):
        env.reset(options={"task": task})
    env.close()


def test_the_first_draw_leaves_x_where_it_is_without_lookalikes(env: HouseholdEnv) -> None:
    plain = chmarl_pb.parallel_env(split="val-unseen")
    for task in TASKS[:4]:
        env.reset(options={"task": task})
        plain.reset(options={"task": task})
        if env.setting.task.seed == task.seed:
            assert np.allclose(env.world.pose(env.setting.goal.item)[0], plain.world.pose(plain.setting.goal.item)[0])
    plain.close()


class Asking(Rearrange):
    """A kind of one's own that cannot be hashed."""

    __hash__ = None  # type: ignore[assignment]


def test_a_task_is_planned_once_whatever_its_kind_and_known_length(monkeypatch: pytest.MonkeyPatch) -> None:
    planned: list[object] = []

    def counted(*given: Any) -> TeamPlan:
        planned.append(given)
        return plan_team(*given)

    monkeypatch.setattr("chmarl_pb.tasks.simulation.plan_team", counted)
    kind, task = Asking(), TASKS[0]
    with closing(Simulation(task.home, lookalikes=True)) as simulation:
        simulation.begin(task, kind)
        before = len(planned)
        plan = simulation.solve(replace(task, optimal_steps=0), kind)
        assert before >= 1 and len(planned) == before
        assert simulation.solve(task, Asking()) == plan, "planned anew for another kind"
        assert len(planned) == before + 1
