"""The flat view, and infos without text, in libraries of others; each is tested where it is installed."""

from contextlib import closing
from typing import Any

import numpy as np
import pytest
from pettingzoo.test import api_test
from pettingzoo.utils.conversions import parallel_to_aec

import chmarl_pb

SPLIT = "val-unseen"


def supersuit_vector(base: str, cpus: int = 0) -> Any:
    """The example of docs/clients.md: two homes, two robots in each."""
    supersuit = pytest.importorskip("supersuit")
    env = supersuit.pettingzoo_env_to_vec_env_v1(chmarl_pb.flat_env(split=SPLIT))
    return supersuit.concat_vec_envs_v1(env, num_vec_envs=2, num_cpus=cpus, base_class=base)


@pytest.mark.parametrize("cpus", [0, 2])
def test_supersuit_shares_a_network_of_stable_baselines3(cpus: int) -> None:
    algorithms = pytest.importorskip("stable_baselines3")
    with closing(supersuit_vector("stable_baselines3", cpus)) as vector:
        model = algorithms.PPO("MlpPolicy", vector, n_steps=32, batch_size=64, n_epochs=1, device="cpu")
        assert vector.num_envs == 4 and model.learn(128).num_timesteps == 128
        assert vector.reset()[:, :2].tolist() == [[1, 0], [0, 1]] * 2  # who is who


def test_supersuit_as_a_vector_of_gymnasium() -> None:
    with closing(supersuit_vector("gymnasium")) as vector:
        seen, _ = vector.reset(seed=0)
        for _ in range(30):  # past the end of an episode
            seen, rewards, *_ = vector.step(np.array([9, 9, 9, 9]))
        assert seen.shape == (4, *vector.observation_space.shape) and rewards[0] == rewards[1]


def test_supersuit_stacks() -> None:
    supersuit = pytest.importorskip("supersuit")
    with closing(supersuit.frame_stack_v1(chmarl_pb.flat_env(split=SPLIT), 3)) as env:
        seen, _ = env.reset(seed=0)
        assert env.observation_space("drone").contains(seen["drone"]) and len(seen["drone"]) == 3 * 842


def test_pettingzoo_turns_it_into_aec() -> None:
    env = parallel_to_aec(chmarl_pb.flat_env(split=SPLIT))
    api_test(env, 20)
    env.close()


def test_torchrl_takes_infos_without_text() -> None:
    pytest.importorskip("torchrl")
    from torchrl.envs import check_env_specs
    from torchrl.envs.libs.pettingzoo import PettingZooWrapper

    env = PettingZooWrapper(chmarl_pb.NumericInfos(chmarl_pb.parallel_env(split=SPLIT)), seed=0)
    check_env_specs(env)
    episode = env.rollout(40)
    assert episode["drone", "info"]["potential"].shape == (len(episode), 1)
    env.close()
    with closing(chmarl_pb.parallel_env(split=SPLIT)) as plain, pytest.raises(TypeError, match="str"):
        PettingZooWrapper(plain, seed=0)


def test_torchrl_has_both_robots_in_one_group() -> None:
    pytest.importorskip("torchrl")
    from torchrl.envs import MarlGroupMapType, check_env_specs
    from torchrl.envs.libs.pettingzoo import PettingZooWrapper

    group = MarlGroupMapType.ALL_IN_ONE_GROUP
    env = PettingZooWrapper(chmarl_pb.flat_env(split=SPLIT), group_map=group, return_state=True, seed=0)
    check_env_specs(env)
    episode = env.rollout(40)
    assert episode["agents", "observation"].shape == (len(episode), 2, 842)
    assert not episode["agents", "action_mask"][:, 1, 9].any()
    assert (episode["agents", "action"][:, 1] < 9).all()  # its random policy obeys the mask
    env.close()


def test_rllib_takes_both_interfaces() -> None:
    wrappers = pytest.importorskip("ray.rllib.env.wrappers.pettingzoo_env")
    with closing(wrappers.ParallelPettingZooEnv(chmarl_pb.flat_env(split=SPLIT))) as env:
        seen, _ = env.reset(seed=0)
        seen, rewards, *_ = env.step({"humanoid": 9, "drone": 9})
        assert seen["drone"].shape == env.get_observation_space("drone").shape == (842,) and set(rewards) == set(seen)
    with closing(wrappers.PettingZooEnv(parallel_to_aec(chmarl_pb.flat_env(split=SPLIT)))) as env:
        seen, _ = env.reset(seed=0)
        assert seen["humanoid"].shape == (842,)
        seen, *_ = env.step({"humanoid": 9})
        assert list(seen) == ["drone"]
