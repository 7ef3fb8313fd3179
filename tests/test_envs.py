"""The environments keep the rules of PettingZoo and Gymnasium, and their own."""

import hashlib
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pybullet
import pytest
from conftest import home_text
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test

import chmarl_pb
from chmarl_pb.envs.parallel import AGENTS, HouseholdEnv
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.errors import ActionError, ChmarlError, HomeError, NotResetError, OptionError, TaskError
from chmarl_pb.homes.solids import inside
from chmarl_pb.tasks.task import Task

# Gymnasium advises float boxes without bounds and pictures of other sizes than ours; both are as meant.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")

HUMANOID_ACTIONS = (
    "goto_kitchen", "goto_bedroom", "goto_bathroom", "goto_livingroom", "pick", "place", "move_forward", "turn_left",
    "turn_right", "stay",
)  # fmt: skip
DRONE_ACTIONS = (
    "goto_kitchen", "goto_bedroom", "goto_bathroom", "goto_livingroom", "move_forward", "move_backward", "move_left",
    "move_right", "stay",
)  # fmt: skip
STAY = {"humanoid": 9, "drone": 8}


@pytest.fixture
def small_home(write_home: Callable[[str], Path]) -> Path:
    return write_home(home_text())


@pytest.fixture
def make() -> Iterator[Callable[..., Any]]:
    """``gym.make`` that closes what it made."""
    made = []

    def make(env_id: str, **options: Any) -> Any:
        made.append(gymnasium.make(env_id, **options))
        return made[-1]

    yield make
    for env in made:
        env.close()


def random_actions(env: HouseholdEnv, rng: np.random.Generator) -> dict[str, int]:
    return {name: int(rng.integers(env.action_space(name).n)) for name in AGENTS}


def digest(*values: Any) -> str:
    """Return a hash of nested observations, infos and rewards, bit by bit."""
    found = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, dict):
            for key in sorted(value):
                found.update(key.encode())
                add(value[key])
        elif isinstance(value, np.ndarray):
            found.update(str((value.dtype, value.shape)).encode() + value.tobytes())
        else:
            found.update(repr(value).encode())

    for value in values:
        add(value)
    return found.hexdigest()


def play(env: HouseholdEnv, seed: int, steps: int = 25) -> str:
    """Play random actions from a seed and return the hash of all that came back."""
    rng = np.random.default_rng(seed)
    results = [env.reset(seed=seed)]
    for _ in range(steps):
        if not env.agents:
            results.append(env.reset())
        results.append(env.step(random_actions(env, rng)))
    return digest(*[part for result in results for part in result])


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
    for name in AGENTS:
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
]


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("env_id", ENV_IDS)
def test_gymnasium_checker(make: Callable[..., Any], env_id: str, options: dict[str, Any]) -> None:
    check_env(make(env_id, **options).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_gymnasium_checker_with_rendering(make: Callable[..., Any], env_id: str) -> None:
    check_env(make(env_id, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("env_id", ENV_IDS[:2])
def test_gymnasium_checker_with_flat_actions(make: Callable[..., Any], env_id: str) -> None:
    check_env(make(env_id, flat_actions=True).unwrapped, skip_render_check=True)


def test_gymnasium_checker_with_a_home_of_one_s_own(make: Callable[..., Any], small_home: Path) -> None:
    for env_id in ENV_IDS[::2]:
        env = make(env_id, home=small_home)
        check_env(env.unwrapped, skip_render_check=True)
        assert env.reset(seed=1)[1]["is_success"] is False


@pytest.mark.parametrize("options", OPTIONS, ids=str)
@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_pettingzoo_parallel(observation: str, options: dict[str, Any]) -> None:
    env = chmarl_pb.parallel_env(observation, **options)
    parallel_api_test(env, num_cycles=3 if "execution" in options else 30)
    env.close()


@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_pettingzoo_aec(observation: str) -> None:
    env = chmarl_pb.env(observation, image_size=32)
    api_test(env, num_cycles=40)
    env.close()


def test_pettingzoo_seeds() -> None:
    parallel_seed_test(lambda: chmarl_pb.parallel_env(split="val-unseen"), num_cycles=60)
    seed_test(lambda: chmarl_pb.env(split="val-unseen"), num_cycles=20)


# Registration and processes


def run_python(code: str, seed: str = "0") -> str:
    """Run Python in a fresh process and return the last line that it prints."""
    root = str(Path(__file__).parents[1])
    environment = {
        **os.environ,
        "PYTHONHASHSEED": seed,
        "PYTHONPATH": os.pathsep.join([root, str(Path(__file__).parent)]),
    }
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().splitlines()[-1]


def test_the_four_ids_are_registered_by_the_import() -> None:
    code = "import gymnasium as gym, chmarl_pb; print(sorted(name for name in gym.registry if 'CHMARL' in name))"
    assert run_python(code) == str(sorted(ENV_IDS))


def test_import_is_light() -> None:
    code = "import sys, chmarl_pb; print([m for m in ('torch', 'pybullet', 'trimesh', 'scipy') if m in sys.modules])"
    assert run_python(code) == "[]"


@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_equal_seeds_give_equal_bits_in_two_processes(observation: str) -> None:
    code = (
        "import test_envs; from chmarl_pb import parallel_env; "
        f"print(test_envs.play(parallel_env({observation!r}, image_size=32), 11, 40))"
    )
    first, second = run_python(code, "1"), run_python(code, "2")
    env = HouseholdEnv(observation, image_size=32)
    play(env, 3)
    assert play(env, 11, 40) == first == second
    env.close()


def test_an_episode_is_the_same_after_others(env: HouseholdEnv, tasks: list[Task]) -> None:
    """Objects that were picked, placed and settled before leave no trace."""

    def episode() -> str:
        results = [*env.reset(options={"task": tasks[1]})]
        for name in plan:
            results += env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 4})
        return digest(*results)

    env.reset(options={"task": tasks[1]})
    plan = env.stage.oracle.plan(env.setting.goal)
    first = episode()
    for seed in range(4):
        play(env, seed)
    assert episode() == first == episode()


def test_twenty_environments_at_once_do_not_touch_each_other() -> None:
    envs = [HouseholdEnv("visual" if number % 4 == 0 else "scene_graph", image_size=32) for number in range(20)]
    rngs = [np.random.default_rng(number) for number in range(20)]
    found = [list(env.reset(seed=number)) for number, env in enumerate(envs)]
    for _ in range(8):
        for env, rng, results in zip(envs, rngs, found, strict=True):
            results += env.step(random_actions(env, rng))
    for env in envs:
        env.close()
    for number in (0, 3, 13, 19):
        env = HouseholdEnv("visual" if number % 4 == 0 else "scene_graph", image_size=32)
        rng, results = np.random.default_rng(number), list(env.reset(seed=number))
        for _ in range(8):
            results += env.step(random_actions(env, rng))
        env.close()
        assert digest(*results) == digest(*found[number])


# Rules of an episode


def test_success_terminates_both_robots(env: HouseholdEnv, tasks: list[Task]) -> None:
    env.reset(options={"task": tasks[0]})
    plan = env.stage.oracle.plan(env.setting.goal)
    for name in plan:
        assert env.agents == list(AGENTS)
        _, _, terminated, truncated, infos = env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 8})
    assert terminated == dict.fromkeys(AGENTS, True) and truncated == dict.fromkeys(AGENTS, False)
    assert infos["drone"]["success"] and infos["humanoid"]["potential"] == 10 and env.agents == []


def test_max_steps_truncates_both_robots() -> None:
    env = HouseholdEnv(max_steps=3)
    env.reset(seed=0)
    for number in range(3):
        _, _, terminated, truncated, _ = env.step(STAY)
        assert terminated == dict.fromkeys(AGENTS, False) and truncated == dict.fromkeys(AGENTS, number == 2)
    assert env.agents == []
    env.close()


def test_success_on_the_last_step_is_no_truncation(tasks: list[Task]) -> None:
    task = tasks[0]
    env = HouseholdEnv(max_steps=task.optimal_steps)
    env.reset(options={"task": task})
    for name in env.stage.oracle.plan(env.setting.goal):
        _, _, terminated, truncated, _ = env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 8})
    assert terminated["drone"] and not truncated["drone"]
    env.close()


def everything(env: HouseholdEnv) -> str:
    """Return a hash of the world, with PyBullet's own poses."""
    client, world = env.world.client, env.world
    poses = {n: pybullet.getBasePositionAndOrientation(b, physicsClientId=client) for n, b in world.bodies.items()}
    robots = {name: robot.pose for name, robot in world.robots.items()}
    arm = env.stage.humanoid.arm.configuration()
    return digest(poses, robots, arm, world.held, sorted(world.supports.items()), env.outcome, env.messages)


def test_failed_actions_change_nothing(env: HouseholdEnv, tasks: list[Task]) -> None:
    failed = set()
    for number, task in enumerate(tasks[:10]):
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        while env.agents:
            chosen = {**STAY, str(rng.choice(AGENTS)): 0}
            chosen = {name: int(rng.integers(env.action_space(name).n)) if chosen[name] == 0 else chosen[name]
                      for name in AGENTS}  # fmt: skip
            before, elapsed = everything(env), env.steps
            _, rewards, _, _, infos = env.step(chosen)
            assert env.steps == elapsed + 1
            for name in AGENTS:
                if not infos[name]["action_success"]:
                    failed.add(env.action_names[name][chosen[name]])
                    other = next(agent for agent in AGENTS if agent != name)
                    assert chosen[other] == STAY[other]
                    assert before == everything(env) and rewards[name] == 0
    assert {"pick", "place", "move_forward"} <= failed and failed & {"move_backward", "move_left", "move_right"}


def assert_nothing_lost(env: HouseholdEnv) -> None:
    low, high = env.stage.home.bounds
    floors = [floor for room in env.stage.home.rooms.values() for floor in room.floors]
    for name in env.world.objects:
        position, quaternion = env.world.pose(name)
        assert np.isfinite([*position, *quaternion]).all(), name
        read = env.world.read_pose(name)
        np.testing.assert_allclose(read[0], position, atol=1e-5)
        x, y, z = position
        assert z > 0.1 and z < 3 and (low - 0.3 <= (x, y)).all() and ((x, y) <= high + 0.3).all(), (name, position)
        if name != env.world.held:
            assert name in env.world.supports
            assert any(inside(floor, np.array([x, y])) for floor in floors)


def random_steps(env: HouseholdEnv, count: int, seed: int) -> None:
    """Take random steps that often pick and place, and check everything after each."""
    rng, total, first = np.random.default_rng(seed), 0.0, 0.0
    for _ in range(count):
        if not env.agents:
            assert total == env.outcome.potential - first if hasattr(env, "outcome") else True
            _, infos = env.reset(seed=int(rng.integers(2**31)))
            first, total = infos["drone"]["potential"], 0.0
        actions = random_actions(env, rng)
        if rng.random() < 0.5:
            actions["humanoid"] = HUMANOID_ACTIONS.index("place" if env.world.held else "pick")
        observations, rewards, terminated, _, infos = env.step(actions)
        total += rewards["humanoid"]
        if actions["humanoid"] in (4, 5):
            assert_nothing_lost(env)
        assert terminated["humanoid"] == infos["humanoid"]["success"] == (infos["drone"]["potential"] == 10)
        for name in AGENTS:
            assert env.observation_space(name).contains(observations[name])


@pytest.mark.parametrize("split", ["train", "val-unseen", "test-unseen"])
def test_random_steps_lose_nothing(split: str) -> None:
    env = HouseholdEnv(split=split)
    random_steps(env, 1200 if split == "train" else 400, seed=7)
    env.close()


@pytest.mark.slow
@pytest.mark.parametrize("split", ["train", "val-unseen", "test-unseen"])
def test_100000_random_steps_lose_nothing(split: str) -> None:
    env = HouseholdEnv(split=split)
    random_steps(env, {"train": 70_000}.get(split, 15_000), seed=8)
    env.close()


# Seeing, telling, the state


def test_messages_and_feedback_can_be_switched_off(tasks: list[Task]) -> None:
    loud, quiet = HouseholdEnv(), HouseholdEnv(messages=False, feedback=False)
    told = 0
    for task in tasks[:5]:
        rng = np.random.default_rng(0)
        results = [env.reset(options={"task": task}) for env in (loud, quiet)]
        for _ in range(10):
            for name in AGENTS:
                heard, silent = results[0][0][name], results[1][0][name]
                told += int(heard["messages"].any()) + int(heard["feedback"].any())
                assert not silent["messages"].any() and not silent["feedback"].any()
                for key in set(heard) - {"messages", "feedback"}:
                    np.testing.assert_array_equal(heard[key], silent[key])
                assert results[1][-1][name]["feedback"] == ""
            if not loud.agents:
                break
            actions = random_actions(loud, rng)
            results = [env.step(actions) for env in (loud, quiet)]
    assert told > 10
    loud.close()
    quiet.close()


def test_observations_are_the_callers_own(env: HouseholdEnv, visual_env: HouseholdEnv) -> None:
    """Writing into an observation changes no later one."""
    for core in (env, visual_env):
        task = core.reset(seed=4)[1]["drone"]["task_id"]
        clean = digest(*core.step(STAY))
        observations, _ = core.reset(options={"task": task})
        for observation in observations.values():
            for array in observation.values():
                array[...] = 1
        assert digest(*core.step(STAY)) == clean


def test_self_tells_room_heading_and_hand(env: HouseholdEnv, tasks: list[Task]) -> None:
    observations, _ = env.reset(options={"task": tasks[0]})
    plan = env.stage.oracle.plan(env.setting.goal)
    for name in plan[: plan.index("pick") + 1]:
        observations, *_ = env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 1})
    own = observations["humanoid"]["self"]
    x, y, yaw = env.stage.humanoid.lattice.pose(env.stage.humanoid.pose)
    assert env.world.home.room_at(np.array([x, y])) == (*env.rooms, "hallway")[int(own[:5].argmax())]
    np.testing.assert_allclose(own[5:], [np.cos(yaw), np.sin(yaw), 1], atol=1e-6)
    np.testing.assert_allclose(observations["drone"]["self"], [0, 1, 0, 0, 0, 0, 1, 0], atol=1e-6)


def test_state_is_fixed_finite_and_tells_apart(env: HouseholdEnv, tasks: list[Task]) -> None:
    shapes, seen = set(), set()
    for task in tasks[:7]:
        env.reset(options={"task": task})
        shapes.add(env.state().shape)
        seen.add(env.state().tobytes())
        assert env.state_space.contains(env.state()) and np.abs(env.state()).max() <= 1.5
        env.step({**STAY, "humanoid": 7})
        seen.add(env.state().tobytes())
    assert shapes == {env.state_space.shape} and len(seen) == 14


def test_render(tasks: list[Task]) -> None:
    env = HouseholdEnv(render_mode="rgb_array", image_size=32)
    env.reset(options={"task": tasks[0]})
    picture = env.render()
    assert picture is not None and picture.dtype == np.uint8 and picture.shape[2] == 3 and picture.std() > 10
    env.close()


# Bad input


def test_every_error_is_one_of_ours() -> None:
    for error in (ActionError, HomeError, NotResetError, OptionError, TaskError):
        assert issubclass(error, ChmarlError)


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
    ],
    ids=str,
)
def test_unknown_option_values(options: dict[str, Any], word: str) -> None:
    with pytest.raises(OptionError, match=word):
        HouseholdEnv(**options)


def test_unknown_option_names(make: Callable[..., Any]) -> None:
    with pytest.raises(TypeError, match="colour"):
        chmarl_pb.parallel_env(colour="red")
    with pytest.raises(TypeError, match="flat_actions"):
        make("CHMARL/SceneGraphHumanoid-v0", flat_actions=True)
    with pytest.raises(OptionError, match="flat_actions='yes'"):
        make("CHMARL/SceneGraph-v0", flat_actions="yes")


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
    env.reset(seed=0)
    env.step({name: kind(number) for name, number in STAY.items()})


def test_a_refused_action_leaves_the_drones_search_as_it_was(make: Callable[..., Any]) -> None:
    first, second = (make("CHMARL/SceneGraphHumanoid-v0").unwrapped for _ in range(2))
    for env in (first, second):
        env.reset(seed=2)
    for _ in range(10):
        with pytest.raises(ActionError):
            first.step(99)
        assert digest(*first.step(7)) == digest(*second.step(7))


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
    for env_id in ENV_IDS[::2]:
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
