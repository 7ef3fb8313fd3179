"""The environments keep the rules of PettingZoo and Gymnasium: spaces, names and the ecosystem's own checkers."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.task import Task
from tests.helpers.env_ids import EACH_ID
from tests.helpers.playing import DRONE_ACTIONS, HUMANOID_ACTIONS

# Gymnasium advises float boxes without bounds and pictures of other sizes than ours; both are as meant.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


# Spaces and names


def test_actions_are_numbered_as_designed(env: HouseholdEnv) -> None:
    assert env.action_names == {"humanoid": HUMANOID_ACTIONS, "drone": DRONE_ACTIONS}
    assert env.rooms == ("kitchen", "bedroom", "bathroom", "livingroom")
    assert env.possible_agents == ["humanoid", "drone"]


def test_observation_keys(env: HouseholdEnv, visual_env: HouseholdEnv) -> None:
    common = {"instruction", "feedback", "messages", "self"}
    assert set(env.observation_space("drone")) == common | {"node_class", "node_state", "edges"}
    assert set(visual_env.observation_space("humanoid")) == common | {"image"}
    assert visual_env.observation_space("drone")["image"] == gymnasium.spaces.Box(0, 255, (32, 32, 3), np.uint8)
    assert env.observation_space("humanoid")["messages"].shape == (2, 4)


def test_joint_spaces(make: Callable[..., Any]) -> None:
    joint = make("CHMARL/SceneGraph-v0")
    assert joint.action_space == gymnasium.spaces.MultiDiscrete([10, 9])
    assert all(key.startswith(("humanoid_", "drone_")) for key in joint.observation_space)
    assert make("CHMARL/SceneGraph-v0", flat_actions=True).action_space == gymnasium.spaces.Discrete(90)
    assert make("CHMARL/SceneGraphHumanoid-v0").action_space == gymnasium.spaces.Discrete(10)


def test_flat_actions_are_the_pairs_in_order(make: Callable[..., Any], tasks: list[Task]) -> None:
    pair, flat = make("CHMARL/SceneGraph-v0"), make("CHMARL/SceneGraph-v0", flat_actions=True)
    for env in (pair, flat):
        env.reset(options={"task": tasks[0]})
    rng = np.random.default_rng(0)
    for _ in range(12):
        humanoid, drone = int(rng.integers(10)), int(rng.integers(9))
        assert digest(*pair.step([humanoid, drone])) == digest(*flat.step(humanoid * 9 + drone))


def test_infos_hold_what_is_promised(env: HouseholdEnv, tasks: list[Task]) -> None:
    _, infos = env.reset(options={"task": tasks[0]})
    keys = {"instruction", "feedback", "action_success", "success", "potential", "visible", "action_mask", "task_id"}
    for name in TEAM:
        assert keys <= set(infos[name]) and infos[name]["task_id"] == tasks[0].id
        assert infos[name]["action_mask"].shape == (env.action_space(name).n,)


def test_joint_info_holds_both_robots(make: Callable[..., Any]) -> None:
    joint, alone = make("CHMARL/SceneGraph-v0"), make("CHMARL/SceneGraphHumanoid-v0")
    _, info = joint.reset(seed=0)
    assert {"humanoid", "drone", "is_success"} <= set(info)
    _, info = alone.reset(seed=0)
    assert {"instruction", "visible", "is_success"} <= set(info)


# The ecosystem's own checkers

OPTIONS: list[dict[str, Any]] = [
    {},
    {"messages": False, "feedback": False},
    {"split": "test-unseen", "image_size": 48, "max_steps": 7},
    {"home": "home_2"},
    {"execution": "simulated", "split": "val-unseen", "max_steps": 4},
    {"track": "grounded", "split": "val-unseen"},
]
#: Each option with the first two ids, which are of both robots, and ids that are not checked with rendering below; the
#: other pairs are of the slow suite.
RENDERED = [param.values[0] for param in EACH_ID if not param.marks]
PAIRS = [
    pytest.param(
        env_id, options, marks=[pytest.mark.slow] * (env_id not in ENV_IDS[:2] if options else env_id in RENDERED)
    )
    for env_id in ENV_IDS
    for options in OPTIONS
]


@pytest.mark.parametrize(("env_id", "options"), PAIRS, ids=str)
def test_gymnasium_checker(make: Callable[..., Any], env_id: str, options: dict[str, Any]) -> None:
    check_env(make(env_id, **options).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", EACH_ID)
def test_gymnasium_checker_with_rendering(make: Callable[..., Any], env_id: str) -> None:
    check_env(make(env_id, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("env_id", ENV_IDS[:2])
def test_gymnasium_checker_with_flat_actions(make: Callable[..., Any], env_id: str) -> None:
    check_env(make(env_id, flat_actions=True).unwrapped, skip_render_check=True)


def test_gymnasium_checker_with_a_home_of_one_s_own(make: Callable[..., Any], small_home: Path) -> None:
    for env_id in ENV_IDS[:4:2]:
        env = make(env_id, home=small_home)
        check_env(env.unwrapped, skip_render_check=True)
        assert env.reset(seed=1)[1]["is_success"] is False


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_pettingzoo_parallel(observation: str, options: dict[str, Any]) -> None:
    env = chmarl_pb.parallel_env(observation, **options)
    parallel_api_test(env, num_cycles=3 if "execution" in options else 30)
    env.close()


@pytest.mark.parametrize("track", ["paper", "grounded"])
@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_pettingzoo_aec(observation: str, track: str) -> None:
    env = chmarl_pb.env(observation, image_size=32, track=track, split="val-unseen")
    api_test(env, num_cycles=40)
    env.close()


def test_pettingzoo_seeds() -> None:
    parallel_seed_test(lambda: chmarl_pb.parallel_env(split="val-unseen"), num_cycles=60)
    seed_test(lambda: chmarl_pb.env(split="val-unseen"), num_cycles=20)
