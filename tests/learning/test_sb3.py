"""Stable-Baselines3 takes the environments as they are."""

from collections.abc import Callable
from typing import Any

import gymnasium
import pytest

from chmarl_pb.envs.registration import ENV_IDS

pytestmark = pytest.mark.filterwarnings("ignore::UserWarning")


@pytest.fixture(scope="module")
def sb3() -> Any:
    found = pytest.importorskip("stable_baselines3")
    import torch

    torch.set_num_threads(1)  # the networks are small: more threads only wait for each other
    return found


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_checker(sb3: Any, make: Callable[..., Any], env_id: str) -> None:
    from stable_baselines3.common.env_checker import check_env

    check_env(make(env_id, image_size=64), warn=False)


def learn(sb3: Any, env: Any, steps: int) -> None:
    """Learn by PPO for some steps and act once."""
    model = sb3.PPO("MultiInputPolicy", env, n_steps=steps // 4, batch_size=steps // 4, n_epochs=1, device="cpu")
    model.learn(steps)
    assert model.num_timesteps == steps
    observation, _ = env.reset(seed=0)
    action, _ = model.predict(observation)
    assert env.action_space.contains(action if getattr(action, "shape", ()) else int(action))


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_ppo_takes_100_steps(sb3: Any, make: Callable[..., Any], env_id: str) -> None:
    learn(sb3, make(env_id, image_size=36), 100)


@pytest.mark.slow
@pytest.mark.parametrize("env_id", ENV_IDS)
def test_ppo_takes_1000_steps(sb3: Any, make: Callable[..., Any], env_id: str) -> None:
    learn(sb3, make(env_id), 1000)


def test_dqn_takes_the_flat_actions(sb3: Any, make: Callable[..., Any]) -> None:
    env = make("CHMARL/SceneGraph-v0", flat_actions=True)
    model = sb3.DQN("MultiInputPolicy", env, buffer_size=200, learning_starts=30, seed=0, device="cpu")
    model.learn(60)
    assert model.num_timesteps == 60


def test_dqn_on_pairs_of_actions_is_told_of_the_flat_ones(sb3: Any, make: Callable[..., Any]) -> None:
    env = make("CHMARL/SceneGraph-v0")
    with pytest.raises(AssertionError, match=r"flat_actions=True for Discrete\(90\)"):
        sb3.DQN("MultiInputPolicy", env)
    assert env.action_space == gymnasium.spaces.MultiDiscrete([10, 9])  # and nothing else about it is new
    assert gymnasium.spaces.MultiDiscrete([10, 9]) == env.action_space
    assert gymnasium.vector.utils.batch_space(env.action_space, 2).shape == (2, 2)
