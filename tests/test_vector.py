"""Vectors of environments: the same as single ones, in this process or in workers, and gone when they are closed."""

import gc
import os
import pickle
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.error import ClosedEnvironmentError
from gymnasium.vector import AutoresetMode, SyncVectorEnv, VectorEnv
from hypothesis import given, settings
from hypothesis import strategies as st
from toy_env import DIE, FAIL, ToyEnv

import chmarl_pb
from chmarl_pb.envs.registration import ENV_IDS
from chmarl_pb.envs.vector import vector_env
from chmarl_pb.envs.vector_engine import WorkerError, WorkerTraceback
from chmarl_pb.envs.vector_infos import ChangeFinder, InfoTable, nest
from chmarl_pb.errors import ActionError, NotResetError, OptionError

COUNT = 5
SAFE = (3, 2)  # actions below these do no harm


def same(first: Any, second: Any) -> bool:
    """Whether two things are equal to the bit, arrays with their dtypes."""
    if isinstance(first, dict):
        return (
            isinstance(second, dict) and first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
        )
    if isinstance(first, tuple | list):
        return len(first) == len(second) and all(map(same, first, second))
    if isinstance(first, np.ndarray) and first.dtype == object:
        return second.dtype == object and first.shape == second.shape and all(map(same, first, second))
    if isinstance(first, np.ndarray):
        return first.dtype == second.dtype and first.shape == second.shape and first.tobytes() == second.tobytes()
    return type(first) is type(second) and first == second


@pytest.fixture(scope="module", params=[0, 2], ids=["in-process", "in-workers"])
def workers(request: pytest.FixtureRequest) -> int:
    return request.param


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


def actions(rng: np.random.Generator, count: int = COUNT) -> np.ndarray:
    return rng.integers((0, 0), SAFE, (count, 2))


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


def flat_toy() -> gymnasium.Env:
    """A toy whose observations are arrays and whose actions are numbers."""
    env = gymnasium.wrappers.FlattenObservation(tame_toy())
    return gymnasium.wrappers.TransformAction(env, lambda action: divmod(action, 2), gymnasium.spaces.Discrete(6))


def test_plain_arrays_and_numbers(make: Callable[..., Any], workers: int) -> None:
    ours, theirs = make(workers=workers, env=flat_toy), SyncVectorEnv([flat_toy] * COUNT)
    assert same(ours.reset(seed=1), theirs.reset(seed=1))
    for chosen in np.random.default_rng(0).integers(0, 6, (9, COUNT)):
        assert same(ours.step(chosen), theirs.step(chosen))


def test_ragged_observations_are_refused() -> None:
    with pytest.raises(OptionError, match="is not an array"):
        vector_env(1, ragged_toy, 0)


def ragged_toy() -> gymnasium.Env:
    env = ToyEnv()
    env.observation_space = gymnasium.spaces.Text(5)
    return env


#: Each key has values of one kind, as the infos of an environment have.
INFOS = st.fixed_dictionaries(
    {"flag": st.booleans()},
    optional={
        "number": st.integers(-5, 5), "share": st.floats(-2, 2), "text": st.text(max_size=2),
        "things": st.tuples(st.sampled_from("ab"), st.sampled_from("ab")),
        "row": st.lists(st.integers(0, 2), max_size=2),
        "array": st.integers(0, 2).map(lambda value: np.full(2, value, np.int16)),
        "robot": st.fixed_dictionaries({"name": st.text(max_size=1)}, optional={"held": st.booleans()}),
    },
)  # fmt: skip


@settings(max_examples=60, deadline=None)
@given(st.lists(st.tuples(INFOS, INFOS), min_size=1, max_size=6))
def test_changes_give_the_infos(steps: list[tuple[dict[str, Any], ...]]) -> None:
    table, finders, flats = InfoTable(2), [ChangeFinder(), ChangeFinder()], [{}, {}]
    gymnasium_env = VectorEnv()
    gymnasium_env.num_envs = 2
    for infos in steps:
        changes = [pickle.loads(pickle.dumps(finder.change(info))) for finder, info in zip(finders, infos, strict=True)]
        table.update(changes)
        wanted: dict[str, Any] = {}
        for number, info in enumerate(infos):
            gymnasium_env._add_info(wanted, info, number)
            flats[number].update(changes[number][0])
            for path in changes[number][1]:
                del flats[number][path]
            assert same(nest(flats[number]), info)
        assert same(table.infos(), wanted)


def test_columns_widen() -> None:
    table = InfoTable(2)
    for value, wanted in ((1, [1, 0]), (0.5, [0.5, 0]), (2, [2, 0]), ("text", ["text", 0])):
        table.update([({("key",): value}, []), ({}, [])])
        assert list(table.infos()["key"]) == wanted


def test_unchanged_infos_do_not_travel() -> None:
    finder = ChangeFinder()
    info = {"robot": {"mask": np.ones(2), "seen": ("a", "b")}, "text": "go"}
    assert len(finder.change(info)[0]) == 3
    info["robot"]["mask"][0] = 5  # changed in place
    assert finder.change(info) == ({("robot", "mask"): pytest.approx(np.array([5, 1]))}, [])
    assert finder.change(info) == ({}, [])
    new, gone = finder.change({})
    assert (new, sorted(gone)) == ({}, [("robot", "mask"), ("robot", "seen"), ("text",)])


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
    "wrong", [np.zeros(2, int), np.zeros((COUNT, 3), int), np.zeros((COUNT, 2)), "go", [[0, 0]] * (COUNT - 1) + [[0]]]
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


def test_wrong_resets_are_refused(make: Callable[..., Any]) -> None:
    env = make(workers=0)
    for wrong in ({"seed": [1, 2]}, {"options": {"reset_mask": [True] * COUNT}}):
        with pytest.raises(OptionError):
            env.reset(**wrong)
    with pytest.raises(OptionError):
        env.reset(options={"reset_mask": np.zeros(COUNT, bool)})


def gone(pid: int, patience: float = 10) -> bool:
    """Whether a process ends in some seconds."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z":
                return True
            os.kill(pid, 0)
        except OSError:
            return True
        time.sleep(0.02)
    return False


def pids(env: Any) -> list[int]:
    return [process.pid for process in env._engine._processes]


def harm(action: int) -> np.ndarray:
    """Actions of which the last environment's is harmful."""
    return np.array([[0, 0]] * (COUNT - 1) + [[action, 0]])


def test_error_in_a_worker(make: Callable[..., Any], workers: int) -> None:
    env = make(workers=workers)
    env.reset(seed=0)
    running = pids(env) if workers else []
    with pytest.raises(ActionError, match="action 3 is not allowed") as raised:
        env.step(harm(FAIL))
    if workers:
        assert isinstance(raised.value.__cause__, WorkerTraceback)
        assert "toy_env.py" in str(raised.value.__cause__)
        assert "[2, 3, 4]" in str(raised.value.__cause__)
    assert all(map(gone, running))
    with pytest.raises(ClosedEnvironmentError):
        env.reset()
    env.close()


def test_death_of_a_worker(make: Callable[..., Any]) -> None:
    env = make()
    env.reset(seed=0)
    running = pids(env)
    with pytest.raises(WorkerError, match=r"environments 2 to 4 died \(exit code 7"):
        env.step(harm(DIE))
    assert all(map(gone, running))
    with pytest.raises(ClosedEnvironmentError):
        env.step(harm(0))


def test_worker_killed_between_steps(make: Callable[..., Any]) -> None:
    env = make()
    env.reset(seed=0)
    os.kill(pids(env)[0], signal.SIGKILL)
    with pytest.raises(WorkerError, match=r"environments 0 to 1 died \(exit code -9"):
        for _ in range(3):
            env.step(harm(0))


def test_what_cannot_travel_harms_nothing(make: Callable[..., Any]) -> None:
    env = make()
    env.reset(seed=0)
    with pytest.raises((AttributeError, TypeError, pickle.PicklingError)):
        env.call("whoami", greeting=lambda: None)
    with pytest.raises((AttributeError, TypeError, RuntimeError, pickle.PicklingError)):
        env.call("secret")
    env.step(harm(0))


def test_error_at_the_start(make: Callable[..., Any], workers: int) -> None:
    with pytest.raises(OptionError, match="is broken"):
        make(workers=workers, env=partial(ToyEnv, broken=True))


def test_close_and_garbage_collection(make: Callable[..., Any]) -> None:
    env = vector_env(2, ToyEnv, 2)
    running = pids(env)
    observations, _ = env.reset()
    env.close()
    env.close()
    assert all(map(gone, running))
    assert observations["picture"].any()
    env = vector_env(2, ToyEnv, 2)
    running = pids(env)
    del env
    gc.collect()
    assert all(map(gone, running))


SCRIPT = """
import sys
from toy_env import ToyEnv
from chmarl_pb.envs.vector import vector_env
if __name__ == "__main__":
    env = vector_env(2, ToyEnv, 2)
    env.reset(seed=0)
    print(*(process.pid for process in env._engine._processes), flush=True)
    while True:
        env.step([[0, 0], [1, 1]])
"""


@pytest.mark.parametrize("deadly", [signal.SIGINT, signal.SIGKILL], ids=["interrupt", "kill"])
def test_nothing_is_left_behind(tmp_path: Path, deadly: signal.Signals) -> None:
    path = tmp_path / "script.py"
    path.write_text(SCRIPT)
    search = os.pathsep.join([str(Path(__file__).parent), str(Path(chmarl_pb.__file__).parents[1])])
    script = subprocess.Popen(
        [sys.executable, str(path)], env={**os.environ, "PYTHONPATH": search}, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip
    assert script.stdout is not None
    running = [int(word) for word in script.stdout.readline().split()]
    assert len(running) == 2
    (os.killpg if deadly is signal.SIGINT else os.kill)(script.pid, deadly)  # Ctrl-C goes to workers as well
    _, errors = script.communicate(timeout=20)
    assert all(map(gone, running))
    assert "leaked" not in errors
    assert errors.count("Traceback") == (deadly is signal.SIGINT)
    end = time.monotonic() + 5  # other tests may just be starting workers
    while left := list(Path("/dev/shm").glob("chmarl-pb-*")):
        assert time.monotonic() < end, left
        time.sleep(0.05)


OPTIONS = {"home": "home_6", "split": "val-unseen", "max_steps": 4}


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
    results = [homes.reset(seed=20)] + [homes.step(each) for each in chosen]
    for number in range(3):
        observation, info = single.reset(seed=20 + number)
        over = False
        assert same({key: value[number] for key, value in results[0][0].items()}, observation)
        assert results[0][1]["drone"]["task_id"][number] == info["drone"]["task_id"]
        for each, (observations, rewards, terminated, truncated, infos) in zip(chosen, results[1:], strict=True):
            if over:
                observation, info = single.reset()
                reward, over = 0.0, False
            else:
                observation, reward, done, cut, info = single.step(each[number])
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


def test_sb3_takes_the_homes(sb3: Any) -> None:
    env = chmarl_pb.sb3_vec_env(2, workers=0, **{**OPTIONS, "max_steps": 2})
    env.seed(0)
    env.reset()
    env.step(np.array([[9, 8], [9, 8]]))
    _, _, dones, infos = env.step(np.array([[9, 8], [9, 8]]))
    assert dones.all()
    for info, begun in zip(infos, env.reset_infos, strict=True):
        assert info["TimeLimit.truncated"]
        assert not info["is_success"]
        assert info["terminal_observation"].keys() == env.observation_space.spaces.keys()
        assert begun["humanoid"]["task_id"] != info["humanoid"]["task_id"]
    env.close()


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_make_vec_finds_every_id(env_id: str) -> None:
    made = gymnasium.make_vec(env_id, 1, image_size=32, **OPTIONS)
    single = made._engine._batch.envs[0]
    assert single.spec.id == env_id
    made.reset(seed=0)
    assert made.observation_space.contains(made.reset()[0])
    made.close()


def test_a_step_too_many_without_autoreset(make: Callable[..., Any]) -> None:
    env = make(1, 0, "CHMARL/SceneGraph-v0", autoreset_mode="Disabled", **{**OPTIONS, "max_steps": 1})
    env.reset(seed=0)
    env.step([[9, 8]])
    with pytest.raises(NotResetError):
        env.step([[9, 8]])


@pytest.fixture(scope="module")
def sb3() -> Any:
    found = pytest.importorskip("stable_baselines3")
    import torch

    torch.set_num_threads(1)  # the networks are small: more threads only wait for each other
    return found


def test_sb3_equals_its_own(sb3: Any, workers: int) -> None:
    from stable_baselines3.common.vec_env import DummyVecEnv

    ours, theirs = chmarl_pb.sb3_vec_env(COUNT, ToyEnv, workers), DummyVecEnv([ToyEnv] * COUNT)
    for env in (ours, theirs):
        env.seed(3)
    assert same(ours.reset(), dict(theirs.reset()))
    assert same(ours.reset_infos, theirs.reset_infos)
    rng = np.random.default_rng(0)
    ended = 0
    for _ in range(20):
        chosen = actions(rng)
        (observations, rewards, dones, infos), wanted = ours.step(chosen), theirs.step(chosen)
        assert same((observations, rewards, dones, infos), (dict(wanted[0]), *wanted[1:]))
        assert same(ours.reset_infos, theirs.reset_infos)
        ended += sum("terminal_observation" in info for info in infos)
    assert ended > 10
    ours.set_options({"steps": 2})
    ours.reset()
    assert [info["robot"]["name"] for info in ours.reset_infos] == ["r2"] * COUNT
    ours.close()


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


def wrapped_toy() -> gymnasium.Env:
    return gymnasium.wrappers.TimeLimit(ToyEnv(), 3)


def tame_toy() -> gymnasium.Env:
    """A toy without pictures and harmful actions."""
    env = gymnasium.wrappers.FilterObservation(ToyEnv(), ["self"])
    return gymnasium.wrappers.TransformAction(env, lambda action: action, gymnasium.spaces.MultiDiscrete(SAFE))


def test_ppo_learns_in_workers(sb3: Any) -> None:
    from stable_baselines3.common.evaluation import evaluate_policy
    from stable_baselines3.common.vec_env import VecMonitor

    env = VecMonitor(chmarl_pb.sb3_vec_env(4, tame_toy, 2))
    model = sb3.PPO("MultiInputPolicy", env, n_steps=16, batch_size=32, n_epochs=1, device="cpu", seed=0)
    model.learn(128)
    assert model.num_timesteps == 128
    assert len(model.ep_info_buffer) >= 16  # episodes of 1 to 6 steps
    rewards, lengths = evaluate_policy(model, env, 6, return_episode_rewards=True)
    assert len(rewards) == 6
    assert max(lengths) <= 6
    env.close()
