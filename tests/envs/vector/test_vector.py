"""Vectors of environments: the same as single ones, in this process or in several."""

import pickle
from collections.abc import Callable, Iterator
from contextlib import closing
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import AlreadyPendingCallError, NoAsyncCallError
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv

import chmarl_pb
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.envs.vector.engine import Engine
from chmarl_pb.envs.vector.env import HouseholdVectorEnv, vector_env
from chmarl_pb.errors import ActionError, NotResetError, OptionError
from tests.helpers.toy_env import ToyEnv
from tests.helpers.toy_vectors import COUNT, EVERYWHERE, actions, same, tame_toy


@pytest.fixture
def make() -> Iterator[Callable[..., Any]]:
    """A function that makes vectors of toys and closes them."""
    made = []

    def make(count: int = COUNT, workers: int = 2, env: Any = ToyEnv, **options: Any) -> Any:
        made.append(vector_env(count, env, workers, **options))
        return made[-1]

    yield make
    for env in made:
        env.close()


@EVERYWHERE
@pytest.mark.parametrize("mode", AutoresetMode)
def test_equals_gymnasium(make: Callable[..., Any], workers: int, mode: AutoresetMode) -> None:
    ours, theirs = make(workers=workers, autoreset_mode=mode), SyncVectorEnv([ToyEnv] * COUNT, autoreset_mode=mode)
    assert ours.metadata == theirs.metadata
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    rng = np.random.default_rng(0)
    assert same(ours.reset(seed=7), theirs.reset(seed=7))
    for _ in range(30):
        chosen = actions(rng)
        result = theirs.step(chosen)
        assert same(ours.step(chosen), result)
        over = result[2] | result[3]
        if mode is AutoresetMode.DISABLED and over.any():
            first, second = ({"reset_mask": over.copy(), "steps": 3} for _ in range(2))
            assert same(ours.reset(options=first), theirs.reset(options=second))
    seeds = [3, None, 5, None, 0]
    assert same(ours.reset(seed=seeds)[0]["self"][::2], theirs.reset(seed=seeds)[0]["self"][::2])


@EVERYWHERE
@pytest.mark.parametrize("seeds", [[1.9, 2, 3, 4, 5], [True, 2, 3, 4, 5], True, 1.5, "1", -1, [-1, 2, 3, 4, 5], [1, 2]])
def test_seeds_are_whole_numbers(make: Callable[..., Any], workers: int, seeds: Any) -> None:
    env = make(workers=workers)
    with pytest.raises(OptionError, match="seed"):
        env.reset(seed=seeds)
    env.reset(seed=np.arange(5))


@EVERYWHERE
def test_a_step_in_two_calls_is_a_step(make: Callable[..., Any], workers: int) -> None:
    first, second = make(workers=workers), make(workers=workers)
    rng = np.random.default_rng(0)
    assert same(first.reset(seed=7), second.reset(seed=7))
    for _ in range(10):
        chosen = actions(rng)
        first.step_async(chosen)
        with pytest.raises(AlreadyPendingCallError, match="waited for"):
            first.step_async(actions(rng))
        assert same(first.step_wait(), second.step(chosen)), "the refused actions have been taken"
    with pytest.raises(NoAsyncCallError):
        first.step_wait()


def flat_toy() -> gymnasium.Env:
    """A toy whose observations are arrays and whose actions are numbers."""
    env = gymnasium.wrappers.FlattenObservation(tame_toy())
    return gymnasium.wrappers.TransformAction(env, lambda action: divmod(action, 2), gymnasium.spaces.Discrete(6))


@EVERYWHERE
def test_plain_arrays_and_numbers(make: Callable[..., Any], workers: int) -> None:
    ours, theirs = make(workers=workers, env=flat_toy), SyncVectorEnv([flat_toy] * COUNT)
    assert same(ours.reset(seed=1), theirs.reset(seed=1))
    for chosen in np.random.default_rng(0).integers(0, 6, (9, COUNT)):
        assert same(ours.step(chosen), theirs.step(chosen))


def test_ragged_observations_are_refused() -> None:
    with pytest.raises(OptionError, match="is not an array"):
        vector_env(1, ragged_toy, 0)


def test_actions_that_are_no_array_are_refused() -> None:
    with pytest.raises(OptionError, match=r"actions: Tuple.* is not an array"):
        vector_env(1, paired_toy, 0)


def paired_toy() -> gymnasium.Env:
    env = ToyEnv()
    env.action_space = gymnasium.spaces.Tuple([gymnasium.spaces.Discrete(5), gymnasium.spaces.Discrete(2)])
    return env


class OwnSpace(gymnasium.Space[np.ndarray]):
    """Two numbers; it does not say when two such spaces are equal."""

    def __init__(self) -> None:
        super().__init__((2,), np.float32)


def own_toy() -> gymnasium.Env:
    env = gymnasium.wrappers.TransformObservation(flat_toy(), lambda values: np.zeros(2, np.float32), OwnSpace())
    env.observation_space = OwnSpace()
    return env


@EVERYWHERE
def test_spaces_of_ones_own_need_no_equality(workers: int) -> None:
    with closing(vector_env(COUNT, own_toy, workers)):
        pass


def test_plain_observations_of_one_vector_are_alike() -> None:
    some = iter((flat_toy(), own_toy()))
    with pytest.raises(OptionError, match=r"environments observe unlike things, key '': .* in environment 1"):
        vector_env(2, lambda: next(some), 0)


def test_environments_of_one_vector_are_alike() -> None:
    some = iter((ToyEnv(), tame_toy(), ToyEnv()))
    with pytest.raises(OptionError, match=r"environment 1 has the actions MultiDiscrete\(\[3 2\]\)"):
        vector_env(3, lambda: next(some), 0)


def ragged_toy() -> gymnasium.Env:
    env = ToyEnv()
    env.observation_space = gymnasium.spaces.Text(5)
    return env


@EVERYWHERE
def test_results_are_the_callers(make: Callable[..., Any], workers: int) -> None:
    env = make(workers=workers)
    observations, infos = env.reset(seed=0)
    kept = pickle.loads(pickle.dumps((observations, infos)))
    env.step(actions(np.random.default_rng(0)))
    assert same((observations, infos), kept)
    infos["robot"]["name"][:] = "x"
    assert "x" not in env.reset(seed=0)[1]["robot"]["name"]


def test_without_copies_the_memory_itself_is_returned(make: Callable[..., Any]) -> None:
    env = make(copy=False, workers=0)
    observations, _ = env.reset(seed=0)
    again = env.step(actions(np.random.default_rng(0)))[0]
    assert np.shares_memory(observations["picture"], again["picture"])


@EVERYWHERE
def test_attributes(make: Callable[..., Any], workers: int) -> None:
    env = make(workers=workers)
    env.reset(seed=10)
    assert env.call("whoami", greeting="seed ") == tuple(f"seed {10 + number}" for number in range(COUNT))
    env.set_attr("mood", ["a", "b", "c", "d", "e"])
    assert env.get_attr("mood") == ("a", "b", "c", "d", "e")
    env.set_attr("mood", "glad")
    assert env.get_attr("mood") == ("glad",) * COUNT
    assert [picture.shape for picture in env.render()] == [(8, 8, 3)] * COUNT
    with pytest.raises(AttributeError):
        env.get_attr("nothing")
    env.step(actions(np.random.default_rng(0)))  # a wrong name has not done any harm


@pytest.mark.parametrize(
    "wrong",
    [
        np.zeros(2, int),
        np.zeros((COUNT, 3), int),
        np.zeros((COUNT, 2)),
        "go",
        [[0, 0]] * (COUNT - 1) + [[0]],
        np.ones((COUNT, 2), bool),
    ],
)
def test_wrong_actions_are_refused(make: Callable[..., Any], wrong: Any) -> None:
    env = make(workers=0)
    env.reset(seed=0)
    with pytest.raises(ActionError):
        env.step(wrong)
    env.step(np.zeros((COUNT, 2), np.int8))


@pytest.mark.parametrize(
    "wrong",
    [{"n": 0}, {"n": 1.5}, {"workers": -1}, {"workers": True}, {"autoreset_mode": "sometimes"}, {"split": "train"}],
)
def test_wrong_arguments_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(OptionError):
        vector_env(**{"n": 2, "env_id": ToyEnv, **wrong})


@pytest.mark.parametrize(("steps", "episode_steps", "limit"), [(40, 35, 35), (31, 50, 31), (20, 12, 12)])
def test_the_nearer_of_two_time_limits_holds(steps: int, episode_steps: int, limit: int) -> None:
    with closing(vector_env(1, workers=0, max_steps=steps, max_episode_steps=episode_steps)) as env:
        env.reset(seed=0)
        ends = [bool(env.step(np.array([[9, 8]]))[3][0]) for _ in range(limit)]
    assert ends == [False] * (limit - 1) + [True]


def test_wrong_resets_are_refused(make: Callable[..., Any]) -> None:
    env = make(workers=0)
    for wrong in ({"seed": [1, 2]}, {"options": {"reset_mask": [True] * COUNT}}):
        with pytest.raises(OptionError):
            env.reset(**wrong)
    with pytest.raises(OptionError):
        env.reset(options={"reset_mask": np.zeros(COUNT, bool)})


OPTIONS: dict[str, Any] = {"home": "home_6", "split": "val-unseen", "max_steps": 4}


@pytest.fixture(scope="module")
def homes() -> Iterator[VectorEnv]:
    """Three real environments in two workers, as ``gymnasium.make_vec`` makes them."""
    made = gymnasium.make_vec("CHMARL/SceneGraph-v0", 3, "vector_entry_point", workers=2, **OPTIONS)
    yield made
    made.close()


def test_vector_of_homes_equals_single_ones(homes: VectorEnv) -> None:
    single = gymnasium.make("CHMARL/SceneGraph-v0", **OPTIONS)
    rng = np.random.default_rng(0)
    chosen = rng.integers(0, (10, 9), (9, 3, 2))
    first, results = homes.reset(seed=20), [homes.step(each) for each in chosen]
    for number in range(3):
        observation, info = single.reset(seed=20 + number)
        over = False
        assert same({key: value[number] for key, value in first[0].items()}, observation)
        assert first[1]["drone"]["task_id"][number] == info["drone"]["task_id"]
        for each, (observations, rewards, terminated, truncated, infos) in zip(chosen, results, strict=True):
            if over:
                observation, info = single.reset()
                reward, over = 0.0, False
            else:
                observation, earned, done, cut, info = single.step(each[number])
                reward = float(earned)
                over = done or cut
                assert (done, cut) == (terminated[number], truncated[number])
            assert same({key: value[number] for key, value in observations.items()}, observation)
            assert rewards[number] == reward
            assert infos["humanoid"]["visible"][number] == info["humanoid"]["visible"]
            assert infos["is_success"][number] == info["is_success"]
    single.close()


def test_task_and_errors_pass_through(homes: VectorEnv) -> None:
    task = next(task for task in chmarl_pb.load_tasks("val-unseen") if task.home == "home_6")
    _, infos = homes.reset(options={"task": task})
    assert list(infos["humanoid"]["task_id"]) == [task.id] * 3
    assert homes.spec is not None
    assert homes.spec.id == "CHMARL/SceneGraph-v0"


def test_make_vec_takes_every_option_of_make() -> None:
    for env_id, observation in (
        ("CHMARL/SceneGraph-v0", ("scene_graph", "depth")),
        ("CHMARL/VisualHumanoid-v1", "text"),
    ):
        options: dict[str, Any] = {"observation": observation, "split": "val-unseen"}
        vector = gymnasium.make_vec(env_id, num_envs=1, **options)
        single = gymnasium.make(env_id, **options)
        assert vector.single_observation_space == single.observation_space
        assert vector.spec is not None and vector.spec.id == env_id
        vector.close()
        single.close()


def test_numbers_of_numpy_are_numbers() -> None:
    two: Any = np.int64(2)
    with closing(vector_env(two, workers=two, split="val-unseen", max_steps=np.int64(40))) as env:
        assert env.num_envs == 2 and env.reset(seed=0)


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_make_vec_finds_every_id(env_id: str) -> None:
    made = gymnasium.make_vec(env_id, 1, image_size=32, **OPTIONS)
    assert isinstance(made, HouseholdVectorEnv)
    assert isinstance(made._engine, Engine)
    single = made._engine._batch.envs[0]
    assert single.spec is not None and single.spec.id == env_id
    made.reset(seed=0)
    assert made.observation_space.contains(made.reset()[0])
    made.close()


def test_a_step_too_many_without_autoreset(make: Callable[..., Any]) -> None:
    env = make(1, 0, "CHMARL/SceneGraph-v0", autoreset_mode="Disabled", **{**OPTIONS, "max_steps": 1})
    env.reset(seed=0)
    env.step([[9, 8]])
    with pytest.raises(NotResetError):
        env.step([[9, 8]])
