"""Vectors of environments for Stable-Baselines3: the same as its own."""

from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb
from tests.helpers.toy_env import ToyEnv
from tests.helpers.toy_vectors import COUNT, EVERYWHERE, actions, same, tame_toy, wrapped_toy


@pytest.fixture(scope="module")
def sb3() -> Any:
    found = pytest.importorskip("stable_baselines3")
    import torch

    torch.set_num_threads(1)  # the networks are small: more threads only wait for each other
    return found


@EVERYWHERE
def test_sb3_equals_its_own(sb3: Any, workers: int) -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    ours, theirs = chmarl_pb.sb3_vec_env(COUNT, ToyEnv, workers), DummyVecEnv([ToyEnv] * COUNT)
    for env in (ours, theirs):
        env.seed(3)
    begun = theirs.reset()
    assert isinstance(begun, dict) and same(ours.reset(), dict(begun))
    assert same(ours.reset_infos, theirs.reset_infos)
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(20):
        chosen = actions(rng)
        (observations, rewards, dones, infos), wanted = ours.step(chosen), theirs.step(chosen)
        assert isinstance(wanted[0], dict)
        assert same((observations, rewards, dones, infos), (dict(wanted[0]), *wanted[1:]))
        assert same(ours.reset_infos, theirs.reset_infos)
        ended += sum("terminal_observation" in info for info in infos)
    assert ended > 10
    ours.set_options({"steps": 2})
    ours.reset()
    assert [info["robot"]["name"] for info in ours.reset_infos] == ["r2"] * COUNT
    ours.close()


class Logged(gymnasium.Wrapper):
    """Tells the actions in one list that grows, and nothing of a first step."""

    def reset(self, **options: Any) -> Any:
        self.log: list[int] = []
        return self.env.reset(**options)[0], {}

    def step(self, action: Any) -> Any:
        self.log.append(int(action[0]))
        return *self.env.step(action)[:4], {"log": self.log} if len(self.log) > 1 else {}


@EVERYWHERE
def test_infos_are_of_their_step_alone(sb3: Any, workers: int) -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    ours, theirs = chmarl_pb.sb3_vec_env(COUNT, logged_toy, workers), DummyVecEnv([logged_toy] * COUNT)
    seen: list[list[Any]] = []
    for env in (ours, theirs):
        env.seed(3)
        env.reset()
        rng = np.random.default_rng(0)
        seen.append([])
        for _ in range(9):
            seen[-1].append(env.step(actions(rng))[3])
            seen[-1][-1][0]["mine"] = seen[-1][-1][0].get("log", []).append(7)  # what is returned is the caller's
    assert same(seen[0], seen[1])
    ours.close()


def logged_toy() -> gymnasium.Env:
    return Logged(ToyEnv())


def test_films_have_the_speed_of_the_environment(sb3: Any) -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    ours, theirs = chmarl_pb.sb3_vec_env(1, ToyEnv, 0), DummyVecEnv([ToyEnv])
    assert ours.metadata == theirs.metadata
    ours.close()


@EVERYWHERE
def test_sb3_attributes(sb3: Any, workers: int) -> None:
    env = chmarl_pb.sb3_vec_env(COUNT, wrapped_toy, workers)
    env.seed(0)
    env.reset()
    assert env.env_method("whoami", indices=[3, -1, 0]) == ["3", "4", "0"]
    env.set_attr("mood", "glad", indices=1)
    assert env.get_attr("mood") == ["calm", "glad", "calm", "calm", "calm"]
    assert env.has_attr("mood")
    assert not env.has_attr("nothing")
    assert env.env_is_wrapped(gymnasium.wrappers.TimeLimit) == [True] * COUNT
    assert env.env_is_wrapped(gymnasium.wrappers.ClipReward, indices=0) == [False]
    assert env.render_mode == "rgb_array"
    picture = env.render()
    assert picture is not None
    assert picture.shape == (24, 16, 3)
    env.step_async(np.zeros((COUNT, 2), int))
    env.reset()  # gives the step up
    env.step(np.zeros((COUNT, 2), int))
    env.close()


def test_ppo_learns_in_workers(sb3: Any) -> None:
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.vec_env import VecMonitor

    env = VecMonitor(chmarl_pb.sb3_vec_env(4, tame_toy, 2))
    model = sb3.PPO("MultiInputPolicy", env, n_steps=16, batch_size=32, n_epochs=1, device="cpu", seed=0)
    model.learn(128)
    assert model.num_timesteps == 128
    assert len(model.ep_info_buffer) >= 16  # episodes of 1 to 6 steps
    rewards, lengths = evaluate_policy(model, env, 6, return_episode_rewards=True)
    assert isinstance(rewards, list) and isinstance(lengths, list)
    assert len(rewards) == 6
    assert max(lengths) <= 6
    env.close()


def test_sb3_takes_the_homes(sb3: Any) -> None:
    env = chmarl_pb.sb3_vec_env(2, workers=0, home="home_6", split="val-unseen", max_steps=2)
    env.seed(0)
    env.reset()
    env.step(np.array([[9, 8], [9, 8]]))
    _, _, dones, infos = env.step(np.array([[9, 8], [9, 8]]))
    assert dones.all()
    space = env.observation_space
    assert isinstance(space, gymnasium.spaces.Dict)
    for info, begun in zip(infos, env.reset_infos, strict=True):
        assert info["TimeLimit.truncated"]
        assert not info["is_success"]
        assert info["terminal_observation"].keys() == space.spaces.keys()
        assert begun["humanoid"]["task_id"] != info["humanoid"]["task_id"]
    env.close()


class Staying(ToyEnv):
    """An environment that plays a hundred episodes in a home, by seeds of a hundred in a row."""

    episodes_in_a_home = 100


@pytest.mark.parametrize(("make", "apart"), [(ToyEnv, 1), (Staying, 100)])
def test_seeds_are_so_far_apart_that_homes_differ(make: type[ToyEnv], apart: int) -> None:
    envs = chmarl_pb.sb3_vec_env(3, make, workers=0)
    assert envs.seed(7) == [7, 7 + apart, 7 + 2 * apart]
    envs.reset()
    assert envs.env_method("whoami") == [str(7 + apart * number) for number in range(3)]
    envs.close()
