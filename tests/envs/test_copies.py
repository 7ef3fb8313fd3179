"""Environments are copied and pickled by their options: a copy has physics of its own and has not been reset."""

import copy
import pickle
from collections.abc import Callable
from contextlib import closing
from functools import partial
from typing import Any

import cloudpickle
import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AsyncVectorEnv, SyncVectorEnv
from pettingzoo import AECEnv

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import CopyError, NotResetError
from chmarl_pb.evaluation.state_hash import state_hash

OPTIONS: dict[str, Any] = {
    "split": "val-unseen",
    "messages": False,
    "feedback": "planner",
    "max_steps": 5,
    "goal": True,
}
MAKERS: dict[str, Callable[[], Any]] = {
    "parallel": partial(chmarl_pb.parallel_env, **OPTIONS),
    "aec": partial(chmarl_pb.env, **OPTIONS),
    "joint": partial(gymnasium.make, "CHMARL/SceneGraph-v0", flat_actions=True, **OPTIONS),
    "joint, bare": lambda: gymnasium.make("CHMARL/Visual-v0", image_size=16, **OPTIONS).unwrapped,
    "humanoid": partial(gymnasium.make, "CHMARL/VisualHumanoid-v0", image_size=16, **OPTIONS),
}
COPIES: dict[str, Callable[[Any], Any]] = {
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: cloudpickle.loads(cloudpickle.dumps(env)),
    "deepcopy": copy.deepcopy,
}


def core(env: Any) -> HouseholdEnv:
    """The environment inside."""
    inside = getattr(env.unwrapped, "parallel", env.unwrapped)
    assert isinstance(inside, HouseholdEnv)
    return inside


def act(env: Any) -> None:
    """Let one robot or both take their first action."""
    if isinstance(env, HouseholdEnv):
        env.step(dict.fromkeys(env.possible_agents, 0))
    elif isinstance(env, AECEnv):
        for _ in env.possible_agents:
            env.step(0)
    else:
        env.step(env.action_space.sample() * 0)


@pytest.mark.parametrize("make_copy", COPIES.values(), ids=COPIES)
@pytest.mark.parametrize("make_env", MAKERS.values(), ids=MAKERS)
def test_a_copy_is_an_environment_of_its_own(make_env: Callable[[], Any], make_copy: Callable[[Any], Any]) -> None:
    with closing(make_env()) as env:
        env.reset(seed=1)
        act(env)
        before = state_hash(core(env))
        with closing(make_copy(env)) as other:
            assert type(other) is type(env)
            assert core(other).options == core(env).options
            assert core(other).world.client != core(env).world.client
            assert getattr(other, "spec", None) == getattr(env, "spec", None)
            with pytest.raises((NotResetError, AssertionError), match="reset"):  # the latter is PettingZoo's
                act(other)
            other.reset(seed=2)
            act(other)
            assert state_hash(core(env)) == before
            env.reset(seed=7)
            other.reset(seed=7)
            for one in (env, other):
                act(one)
            assert state_hash(core(env)) == state_hash(core(other))
        env.reset(seed=7)
        act(env)


def test_a_copy_outlives_what_it_was_made_of() -> None:
    env = chmarl_pb.parallel_env()
    env.reset(seed=0)
    other = copy.copy(env)
    env.close()
    with closing(copy.deepcopy(env)) as third, closing(other):
        hashes = []
        for one in (other, third):
            one.reset(seed=0)
            one.step(dict.fromkeys(one.agents, 0))
            hashes.append(state_hash(one))
        assert hashes[0] == hashes[1]


@pytest.mark.parametrize("make_copy", [*COPIES.values(), copy.copy], ids=[*COPIES, "copy"])
def test_worlds_and_vectors_refuse_to_be_copied(env: HouseholdEnv, make_copy: Callable[[Any], Any]) -> None:
    for what in (env.world, env.simulation, env.simulation.oracle.world, env.world.physics):
        with pytest.raises(CopyError, match="cannot be copied or pickled; copy the environment instead"):
            make_copy(what)
    with closing(chmarl_pb.vector_env(1, workers=0)) as vector:
        with pytest.raises(CopyError, match=r"HouseholdVectorEnv .*make another by vector_env"):
            make_copy(vector)
        vector.reset(seed=0)


# What others do with copies


@pytest.mark.parametrize("vector", [SyncVectorEnv, partial(AsyncVectorEnv, context="spawn"), AsyncVectorEnv])
def test_vectors_of_gymnasium(vector: Callable[..., Any]) -> None:
    """Of environments of gymnasium.make, and of copies of one."""
    env = gymnasium.make("CHMARL/SceneGraph-v0")
    make_copy = cloudpickle.loads(cloudpickle.dumps(lambda: copy.deepcopy(env)))
    make_env = partial(gymnasium.make, "chmarl_pb:CHMARL/SceneGraph-v0")  # a spawned worker has not imported us
    with closing(vector([make_env, make_copy])) as envs:
        seen, _ = envs.reset(seed=[3, 3])
        for _ in range(3):
            assert all((array[0] == array[1]).all() for array in seen.values())
            seen, *_ = envs.step(np.array([[1, 2], [1, 2]]))
    env.close()


@pytest.mark.parametrize("name", ["DummyVecEnv", "SubprocVecEnv"])
def test_vectors_of_stable_baselines3(name: str) -> None:  # workers import us by the name before the colon
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    make_env = pytest.importorskip("stable_baselines3.common.env_util").make_vec_env
    with closing(
        make_env("chmarl_pb:CHMARL/SceneGraphHumanoid-v0", 2, seed=0, vec_env_cls=getattr(vec_env, name))
    ) as envs:
        envs.reset()
        for _ in range(3):
            seen, rewards, _, infos = envs.step(np.array([9, 0]))
    assert len(rewards) == len(infos) == len(seen["instruction"]) == 2


def padded() -> Any:
    """The example of docs/environments.md."""
    supersuit = pytest.importorskip("supersuit")
    return supersuit.pad_action_space_v0(chmarl_pb.parallel_env(split="train"))


def test_a_padded_action_is_the_first_one() -> None:
    with closing(padded()) as env:
        assert env.action_space("drone") == env.action_space("humanoid")
        hashes = []
        for action in (9, 0):
            env.reset(seed=0)
            env.step({"humanoid": 9, "drone": action})
            hashes.append(state_hash(env.unwrapped))
        assert hashes[0] == hashes[1]


@pytest.mark.parametrize("cpus", [0, 2])
def test_supersuit_and_stable_baselines3_train(cpus: int) -> None:
    env, supersuit = padded(), pytest.importorskip("supersuit")
    algorithms = pytest.importorskip("stable_baselines3")
    vector = supersuit.pettingzoo_env_to_vec_env_v1(env)
    vector = supersuit.concat_vec_envs_v1(vector, num_vec_envs=2, num_cpus=cpus, base_class="stable_baselines3")
    try:
        assert vector.num_envs == 4
        model = algorithms.PPO("MultiInputPolicy", vector, n_steps=32, batch_size=64, n_epochs=1)
        assert model.learn(256).num_timesteps == 256
    finally:
        vector.close()
        env.close()
