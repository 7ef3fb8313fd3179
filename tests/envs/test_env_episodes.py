"""Episodes: the same in every process, ended as promised, and what the robots see and are told in them."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.homes.solids import inside
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.task import Task
from tests.helpers.playing import HUMANOID_ACTIONS, STAY, everything, play, random_actions, room_at

# Gymnasium advises float boxes without bounds and pictures of other sizes than ours; both are as meant.
pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


# Registration and processes


def run_python(code: str, seed: str = "0") -> str:
    """Run Python in a fresh process and return the last line that it prints."""
    root = str(Path(__file__).parents[2])
    environment = {
        **os.environ,
        "PYTHONHASHSEED": seed,
        "PYTHONPATH": root,
    }
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, env=environment, timeout=300)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip().splitlines()[-1]


def test_the_ids_are_registered_by_the_import() -> None:
    code = "import gymnasium as gym, chmarl_pb; print(sorted(name for name in gym.registry if 'CHMARL' in name))"
    assert run_python(code) == str(sorted(ENV_IDS))


def test_import_is_light() -> None:
    code = "import sys, chmarl_pb; print([m for m in ('torch', 'pybullet', 'trimesh', 'scipy') if m in sys.modules])"
    assert run_python(code) == "[]"


@pytest.mark.parametrize("observation", ["scene_graph", "visual"])
def test_equal_seeds_give_equal_bits_in_two_processes(observation: str) -> None:
    code = (
        "from tests.helpers import playing; from chmarl_pb import parallel_env; "
        f"print(playing.play(parallel_env({observation!r}, image_size=32), 11, 40))"
    )
    env = HouseholdEnv(observation, image_size=32)
    play(env, 3)
    assert play(env, 11, 40) == run_python(code, "1")  # where texts have other hashes than here
    env.close()


def test_an_episode_is_the_same_after_others(env: HouseholdEnv, tasks: list[Task]) -> None:
    """Objects that were picked, placed and settled before leave no trace."""

    def episode() -> str:
        results: list[Any] = [*env.reset(options={"task": tasks[1]})]
        for name in plan:
            results += env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 4})
        return digest(*results)

    env.reset(options={"task": tasks[1]})
    plan = env.simulation.oracle.plan(env.setting.goal)
    first = episode()
    for seed in range(4):
        play(env, seed)
    assert episode() == first == episode()


def test_twenty_environments_at_once_do_not_touch_each_other() -> None:
    envs = [HouseholdEnv("visual" if number % 4 == 0 else "scene_graph", image_size=32) for number in range(20)]
    rngs = [np.random.default_rng(number) for number in range(20)]
    found: list[list[Any]] = [list(env.reset(seed=number)) for number, env in enumerate(envs)]
    for _ in range(8):
        for env, rng, results in zip(envs, rngs, found, strict=True):
            results += env.step(random_actions(env, rng))
    for env in envs:
        env.close()
    for number in (0, 3, 13, 19):
        env = HouseholdEnv("visual" if number % 4 == 0 else "scene_graph", image_size=32)
        rng = np.random.default_rng(number)
        alone: list[Any] = list(env.reset(seed=number))
        for _ in range(8):
            alone += env.step(random_actions(env, rng))
        env.close()
        assert digest(*alone) == digest(*found[number])


# Rules of an episode


def test_success_terminates_both_robots(env: HouseholdEnv, tasks: list[Task]) -> None:
    env.reset(options={"task": tasks[0]})
    plan = env.simulation.oracle.plan(env.setting.goal)
    for name in plan:
        assert env.agents == list(TEAM)
        _, _, terminated, truncated, infos = env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 8})
    assert terminated == dict.fromkeys(TEAM, True) and truncated == dict.fromkeys(TEAM, False)
    assert infos["drone"]["success"] and infos["humanoid"]["potential"] == 10 and env.agents == []


def test_max_steps_truncates_both_robots() -> None:
    env = HouseholdEnv(max_steps=3)
    env.reset(seed=0)
    for number in range(3):
        _, _, terminated, truncated, _ = env.step(STAY)
        assert terminated == dict.fromkeys(TEAM, False) and truncated == dict.fromkeys(TEAM, number == 2)
    assert env.agents == []
    env.close()


def test_success_on_the_last_step_is_no_truncation(tasks: list[Task]) -> None:
    task = tasks[0]
    env = HouseholdEnv(max_steps=task.optimal_steps)
    env.reset(options={"task": task})
    for name in env.simulation.oracle.plan(env.setting.goal):
        _, _, terminated, truncated, _ = env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 8})
    assert terminated["drone"] and not truncated["drone"]
    env.close()


def test_failed_actions_change_nothing(env: HouseholdEnv, tasks: list[Task]) -> None:
    failed = set()
    for number, task in enumerate(tasks[:10]):
        rng = np.random.default_rng(number)
        env.reset(options={"task": task})
        while env.agents:
            chosen = {**STAY, str(rng.choice(TEAM)): 0}
            chosen = {name: int(rng.integers(env.action_space(name).n)) if chosen[name] == 0 else chosen[name]
                      for name in TEAM}  # fmt: skip
            before, elapsed = everything(env), env.steps
            _, rewards, _, _, infos = env.step(chosen)
            assert env.steps == elapsed + 1
            for name in TEAM:
                if not infos[name]["action_success"]:
                    failed.add(env.action_names[name][chosen[name]])
                    other = next(agent for agent in TEAM if agent != name)
                    assert chosen[other] == STAY[other]
                    assert before == everything(env) and rewards[name] == 0
    assert {"pick", "place", "move_forward"} <= failed and failed & {"move_backward", "move_left", "move_right"}


def assert_nothing_lost(env: HouseholdEnv) -> None:
    low, high = env.simulation.home.bounds
    floors = [floor for room in env.simulation.home.rooms.values() for floor in room.floors]
    for name in env.world.objects:
        position, quaternion = env.world.pose(name)
        assert np.isfinite([*position, *quaternion]).all(), name
        read = env.world.physics.read_object(name)
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
        for name in TEAM:
            assert env.observation_space(name).contains(observations[name])


@pytest.mark.parametrize("split", ["train", "val-unseen", "test-unseen"])
def test_random_steps_lose_nothing(split: str) -> None:
    env = HouseholdEnv(split=split)
    random_steps(env, 600 if split == "train" else 300, seed=7)
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
    known = 0
    for task in tasks[:5]:
        rng = np.random.default_rng(0)
        results: list[tuple[Any, ...]] = [env.reset(options={"task": task}) for env in (loud, quiet)]
        for _ in range(10):
            for name in TEAM:
                heard, silent = results[0][0][name], results[1][0][name]
                known += int(heard["messages"].any()) + int(heard["feedback"].any())
                assert not silent["messages"].any() and not silent["feedback"].any()
                for key in set(heard) - {"messages", "feedback"}:
                    np.testing.assert_array_equal(heard[key], silent[key])
                assert results[1][-1][name]["feedback"] == ""
            if not loud.agents:
                break
            actions = random_actions(loud, rng)
            results = [env.step(actions) for env in (loud, quiet)]
    assert known > 10
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
    plan = env.simulation.oracle.plan(env.setting.goal)
    for name in plan[: plan.index("pick") + 1]:
        observations, *_ = env.step({"humanoid": HUMANOID_ACTIONS.index(name), "drone": 1})
    own = observations["humanoid"]["self"]
    x, y, yaw = env.simulation.oracle.robot.lattice.pose(env.simulation.oracle.robot.pose)
    assert room_at(env.world.home, x, y) == (*env.rooms, "hallway")[int(own[:5].argmax())]
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
