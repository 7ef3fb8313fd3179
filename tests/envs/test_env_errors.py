"""Bad input to environments: one clear error, and nothing half done."""

import json
from collections.abc import Callable
from contextlib import closing
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pybullet
import pytest

import chmarl_pb
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.errors import ActionError, AssetError, HomeError, NotResetError, OptionError, TaskError
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.tasks.task import Task
from tests.helpers.playing import STAY, everything

# Gymnasium advises float boxes without bounds and pictures of other sizes than ours; both are as meant.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


# Bad input


@pytest.mark.parametrize(
    ("options", "word"),
    [
        ({"observation": "graph"}, "observation='graph'"),
        ({"split": "test"}, "split='test'"),
        ({"execution": "fast"}, "execution='fast'"),
        ({"render_mode": "ansi"}, "render_mode='ansi'"),
        ({"messages": "yes"}, "messages='yes'"),
        ({"messages": None}, "messages=None"),
        ({"feedback": "loud"}, "feedback='loud'"),
        ({"max_steps": 0}, "max_steps=0"),
        ({"max_steps": 2.5}, "max_steps=2.5"),
        ({"max_steps": True}, "max_steps=True"),
        ({"image_size": 8}, "image_size=8"),
        ({"image_size": "128"}, "image_size='128'"),
        ({"split": ["train"]}, "split="),
        ({"track": "hard"}, "track='hard'"),
        ({"pointing": None}, "pointing=None"),
        ({"pointing": 1.0}, r"pointing=1\.0"),
        ({"goal": 1.0}, r"goal=1\.0"),
        ({"feedback": 1}, "feedback=1"),
        ({"feedback": np.array([1, 2])}, "feedback=array"),
        ({"templates": 2.0}, r"templates=2\.0"),
        ({"templates": True}, "templates=True"),
        ({"max_steps": np.float64(28)}, "max_steps="),
        ({"robots": ("humanoid", 3)}, "3 is no robot"),
        ({"catalog": 5}, "catalog=5 is no path"),
    ],
    ids=str,
)
def test_unknown_option_values(options: dict[str, Any], word: str) -> None:
    with pytest.raises(OptionError, match=word):
        HouseholdEnv(**options)


def test_values_of_numpys_are_pythons_and_equal_rules_are_recorded_alike() -> None:
    given: dict[str, Any] = {"pointing": np.True_, "goal": np.False_, "feedback": np.True_, "templates": np.int32(2)}
    plain: dict[str, Any] = {"pointing": True, "goal": False, "feedback": "paper", "templates": 2}
    steps: dict[str, Any] = {"max_steps": np.int64(28)}
    one, other = Options(**given), Options(**plain)
    assert one == other and json.dumps(one.recorded()) == json.dumps(other.recorded())
    assert {type(getattr(one, name)) for name in ("pointing", "goal", "feedback")} == {bool}
    assert type(one.templates) is int and type(Options(**steps).max_steps) is int


def test_names_that_are_too_long_for_a_file() -> None:
    for error, option in ((HomeError, "home"), (AssetError, "catalog")):
        with pytest.raises(error):
            HouseholdEnv(**{option: "a" * 5000})
    with pytest.raises(AssetError, match="no robot"):
        HouseholdEnv(robots=("a" * 5000,))


def test_options_of_the_views(make: Callable[..., Any]) -> None:
    env = make("CHMARL/SceneGraph-v0", flat_actions=np.True_, disable_env_checker=True)
    assert env.action_space.n == 90
    with pytest.raises(OptionError, match="max_steps=5000"):
        make("CHMARL/SceneGraph-v0", max_steps=np.int64(5000))
    with pytest.raises(OptionError, match="partner=array"):
        make("CHMARL/SceneGraphHumanoid-v0", partner=np.array(["search", "belief"]))


def test_unknown_option_names(make: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match="colour"):
        chmarl_pb.parallel_env(colour="red")
    with pytest.raises(TypeError, match="flat_actions"):
        make("CHMARL/SceneGraphHumanoid-v0", flat_actions=True)
    with pytest.raises(OptionError, match="flat_actions='yes'"):
        make("CHMARL/SceneGraph-v0", flat_actions="yes")


@pytest.mark.parametrize("seed", [-1, 1.5, "7", True])
def test_bad_seeds(make: Callable[..., Any], env: HouseholdEnv, seed: Any) -> None:
    with pytest.raises(OptionError, match="seed="):
        env.reset(seed=seed)
    for env_id in ("CHMARL/SceneGraph-v0", "CHMARL/SceneGraphHumanoid-v0"):
        with pytest.raises(OptionError, match="seed="):
            make(env_id).unwrapped.reset(seed=seed)


@pytest.mark.parametrize("first", [True, False], ids=["first robot", "second robot"])
def test_a_wrong_action_of_the_aec_view_is_refused_at_its_turn(first: bool) -> None:
    aec = chmarl_pb.env(split="val-unseen")
    aec.reset(seed=0)
    if not first:
        aec.step(STAY["humanoid"])
    robot = aec.agent_selection
    for wrong in (99, None, "stay"):
        with pytest.raises(ActionError, match=robot):
            aec.step(wrong)
        assert aec.agent_selection == robot and aec.unwrapped.steps == 0
    for name in (["humanoid"] if first else []) + ["drone"]:
        aec.step(STAY[name])
    assert aec.unwrapped.steps == 1
    aec.close()


def test_options_that_are_no_dict(env: HouseholdEnv) -> None:
    with pytest.raises(OptionError, match="not a dict"):
        env.reset(options="train-0001")  # type: ignore[arg-type]


def test_rollout_plays_in_nothing_else(make: Callable[..., Any]) -> None:
    with pytest.raises(OptionError, match="parallel_env"):
        chmarl_pb.rollout(make("CHMARL/SceneGraph-v0"), policy=None)  # type: ignore[arg-type]


@pytest.mark.parametrize("home", ["home_99", "/nowhere/home.urdf", 7])
def test_unknown_home(home: Any) -> None:
    with pytest.raises(HomeError, match="no such home"):
        HouseholdEnv(home=home)


def test_unknown_tasks(env: HouseholdEnv) -> None:
    for task, words in (("train-99999", "unknown task"), (3, "int"), (None, "NoneType")):
        with pytest.raises(TaskError, match=words):
            env.reset(options={"task": task})
    with pytest.raises(HomeError, match="home_99"):
        env.reset(options={"task": Task("t", "home_99", "mug", "bed", "desk", 0)})


def test_a_reset_that_fails_leaves_no_half_episode(env: HouseholdEnv) -> None:
    env.reset(seed=0)
    with pytest.raises(TaskError, match="home_4 has no desk"):
        env.reset(options={"task": Task("t", "home_4", "mug", "bed", "desk", 0)})
    with pytest.raises(NotResetError):
        env.step(STAY)
    env.reset(seed=0)
    env.step(STAY)


BAD_ACTIONS: list[Any] = [
    -1, 10, 10**30, 1.0, 1.5, float("nan"), "1", None, True, [1, 2], np.array([1.0]), np.float32(2), object,
]  # fmt: skip


@pytest.mark.parametrize("action", BAD_ACTIONS, ids=repr)
def test_bad_actions(env: HouseholdEnv, action: Any) -> None:
    env.reset(seed=0)
    before = everything(env)
    with pytest.raises(ActionError, match=r"humanoid.*whole number from 0 to 9"):
        env.step({"humanoid": action, "drone": 0})
    assert everything(env) == before and env.steps == 0
    env.step(STAY)


@pytest.mark.parametrize(
    "actions", [{}, {"humanoid": 0}, {**STAY, "cat": 1}, None, 3, [0, 0], {0: 1, "drone": 2}], ids=repr
)
def test_missing_actions(env: HouseholdEnv, actions: Any) -> None:
    env.reset(seed=0)
    with pytest.raises(ActionError, match="each of"):
        env.step(actions)


@pytest.mark.parametrize("action", [1, [1], [1, 2, 3], [10, 0], [0, 9], [0.5, 1], None, [[1], [2, 3]], "ab", [-1, 0]])
def test_bad_joint_actions(make: Callable[..., Any], action: Any) -> None:
    env = make("CHMARL/SceneGraph-v0", disable_env_checker=True).unwrapped
    env.reset(seed=0)
    with pytest.raises(ActionError):
        env.step(action)


@pytest.mark.parametrize("action", [90, -1, 0.5, None, [1, 2], True])
def test_bad_flat_actions(make: Callable[..., Any], action: Any) -> None:
    env = make("CHMARL/SceneGraph-v0", flat_actions=True, disable_env_checker=True).unwrapped
    env.reset(seed=0)
    with pytest.raises(ActionError, match="0 to 89"):
        env.step(action)


@pytest.mark.parametrize("kind", [np.int64, np.uint8, np.int32, lambda n: np.array(n), lambda n: np.array([n])])
def test_numpy_integers_are_actions(env: HouseholdEnv, kind: Callable[[int], Any]) -> None:
    moves = dict.fromkeys(STAY, 4)
    steps = []
    for given in (moves, {name: kind(number) for name, number in moves.items()}):
        env.reset(seed=0)
        env.step(given)
        steps.append(state_hash(env))
    assert steps[0] == steps[1]


def test_a_refused_action_leaves_the_drones_search_as_it_was(make: Callable[..., Any]) -> None:
    first, second = (make("CHMARL/SceneGraphHumanoid-v0").unwrapped for _ in range(2))
    for env in (first, second):
        env.reset(seed=2)
    for _ in range(10):
        with pytest.raises(ActionError):
            first.step(99)
        assert digest(*first.step(7)) == digest(*second.step(7))


def test_a_list_of_lists_is_no_action(env: HouseholdEnv) -> None:
    env.reset(seed=0)
    talking = HouseholdEnv(messages="symbols")
    talking.reset(seed=0)
    for one in (env, talking):
        with pytest.raises(ActionError, match=r"humanoid.*not an array of numbers"):
            one.step({"humanoid": [[1], [1, 2]], "drone": 0})
    talking.close()


class Untold:
    """An action that no array can be made of, as a tensor that requires a gradient, or lies on a GPU."""

    def __init__(self, error: Exception):
        self.error = error

    def __array__(self, *given: Any, **named: Any) -> Any:
        raise self.error

    def __len__(self) -> int:
        return 2


@pytest.mark.parametrize("error", [RuntimeError("grad"), TypeError("cuda"), KeyError()])
def test_actions_that_numpy_cannot_read_are_refused(error: Exception, env: HouseholdEnv) -> None:
    words = r"is not an array of numbers; give whole numbers, of a tensor those of \.tolist\(\)$"
    env.reset(seed=0)
    with pytest.raises(ActionError, match=f"^drone: action .*Untold.* {words}"):
        env.step({"humanoid": 9, "drone": Untold(error)})
    joint = gymnasium.make("CHMARL/SceneGraph-v0").unwrapped
    joint.reset(seed=0)
    with pytest.raises(ActionError, match=f"^action .*Untold.* {words}"):
        joint.step(Untold(error))


def test_a_tensor_that_requires_a_gradient_is_no_action(env: HouseholdEnv) -> None:
    torch = pytest.importorskip("torch")
    env.reset(seed=0)
    env.step({"humanoid": torch.tensor(9), "drone": 8})
    with pytest.raises(ActionError, match=r"humanoid: action tensor.* is not an array of numbers"):
        env.step({"humanoid": torch.tensor(9.0, requires_grad=True), "drone": 8})
    with closing(chmarl_pb.vector_env(1, workers=1)) as vector:
        vector.reset(seed=0)
        with pytest.raises(ActionError, match=r"are not an array \(1, 2\)"):
            vector.step(torch.zeros(1, 2, requires_grad=True))


@pytest.mark.parametrize("name", ["task", "setting", "outcome", "messages", "instruction"])
def test_what_reset_sets_says_so_before(name: str) -> None:
    env = HouseholdEnv()
    with pytest.raises(NotResetError, match=rf"{name} before reset\(\); call reset\(\) first"):
        getattr(env, name)
    assert not hasattr(env, name)
    env.reset(seed=0)
    assert getattr(env, name) is not None
    env.close()


def test_order_of_calls(make: Callable[..., Any]) -> None:
    env = HouseholdEnv(max_steps=1, render_mode="rgb_array")
    for call in (lambda: env.step(STAY), env.state, env.render):
        with pytest.raises(NotResetError, match=r"reset\(\)"):
            call()
    env.reset(seed=0)
    env.step(STAY)
    with pytest.raises(NotResetError, match=r"reset\(\)"):
        env.step(STAY)
    env.close()
    env.close()
    with pytest.raises(NotResetError):
        env.step(STAY)
    for env_id in ENV_IDS[:4:2]:
        view = make(env_id).unwrapped
        with pytest.raises(NotResetError, match=r"reset\(\)"):
            view.step([0, 0] if "Humanoid" not in env_id else 0)
        view.close()
        view.close()


def test_render_without_a_mode(env: HouseholdEnv) -> None:
    env.reset(seed=0)
    with pytest.raises(OptionError, match="render_mode"):
        env.render()


def test_closing_frees_the_clients() -> None:
    def clients() -> int:
        return sum(pybullet.isConnected(number) for number in range(200))

    HouseholdEnv("visual", image_size=32).close()
    before = clients()
    for _ in range(3):
        env = HouseholdEnv()
        env.reset(seed=1)
        assert clients() > before
        env.close()
    assert clients() == before


def test_a_home_with_other_rooms_is_refused_in_a_running_environment(env: HouseholdEnv, small_home: Path) -> None:
    with pytest.raises(HomeError, match="environment of its own"):
        env.reset(options={"task": Task("t", str(small_home), "mug", "desk", "sofa", 0)})


def test_nor_after_it_was_closed(small_home: Path) -> None:
    env = HouseholdEnv(split="val-unseen")
    env.reset(seed=0)
    env.close()
    with pytest.raises(HomeError, match="environment of its own"):
        env.reset(options={"task": Task("t", str(small_home), "mug", "desk", "sofa", 0)})
    env.close()


def test_a_closed_environment_answers_for_no_other() -> None:
    closed = HouseholdEnv(split="val-unseen")
    closed.reset(seed=0)
    world = closed.world
    closed.close()
    other = HouseholdEnv(split="val-unseen")
    other.reset(seed=0)
    assert world.client < 0 <= other.world.client
    other.close()


def test_bodies_are_where_the_state_says_also_where_the_planner_advises() -> None:
    env = HouseholdEnv(split="val-unseen", feedback="planner")
    env.reset(seed=0)
    env.action_space("humanoid").seed(0)
    while env.agents:
        for name, robot in env.world.physics.robots.items():
            place, _ = pybullet.getBasePositionAndOrientation(robot.body, physicsClientId=env.world.client)
            assert np.allclose(place[:2], env.world.state.robots[name].base[0][:2], atol=1e-3)
        env.step({name: env.action_space(name).sample() for name in env.agents})
    env.close()
