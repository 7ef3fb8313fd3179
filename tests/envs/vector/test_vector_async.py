"""Environments that do not wait for each other: each plays what it would play in lockstep, whoever is ready first."""

import fcntl
import os
import signal
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from gymnasium.error import AlreadyPendingCallError, ClosedEnvironmentError, NoAsyncCallError
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

import chmarl_pb
from chmarl_pb.envs.vector.asynchronous import HouseholdAsyncEnv
from chmarl_pb.envs.vector.engine import WorkerTraceback
from chmarl_pb.envs.vector.env import vector_env
from chmarl_pb.errors import ActionError, CopyError, OptionError, WorkerError
from tests.helpers.toy_env import DIE, FAIL, ToyEnv
from tests.helpers.toy_vectors import COUNT, EVERYWHERE, SAFE, same

pytestmark = pytest.mark.usefixtures("spawned")

Make = Callable[..., HouseholdAsyncEnv]
HOMES: dict[str, Any] = {"env_id": "CHMARL/SceneGraph-v0", "home": "home_6", "split": "val-unseen", "max_steps": 4}


@pytest.fixture
def make() -> Iterator[Make]:
    """A function that makes vectors of toys and closes them; with two workers 0 and 1 live here, 2 to 4 in a worker."""
    made = []

    def make(batch_size: int = 2, workers: int = 2, count: int = COUNT, **options: Any) -> HouseholdAsyncEnv:
        made.append(vector_env(count, workers=workers, batch_size=batch_size, **{"env_id": ToyEnv, **options}))
        return made[-1]

    yield make
    for envs in made:
        envs.close()


def alone(infos: dict[str, Any], index: int) -> dict[str, Any]:
    """The info of one environment of a vector."""
    info = {}
    for key, values in infos.items():
        if infos.get(f"_{key}", np.zeros(index + 1))[index]:
            info[key] = alone(values, index) if isinstance(values, dict) and key != "final_obs" else values[index]
    return info


def result(observations: Any, others: tuple[Any, ...], infos: dict[str, Any], index: int) -> list[Any]:
    seen = {key: value[index] for key, value in observations.items()}
    return [seen, *(value[index] for value in others), alone(infos, index)]


def in_lockstep(chosen: np.ndarray, workers: int, **options: Any) -> list[list[Any]]:
    """What each environment answers to its actions, (steps, count, 2), in a vector in lockstep."""
    count = chosen.shape[1]
    envs = vector_env(count, workers=workers, **{"env_id": ToyEnv, **options})
    try:
        observations, infos = envs.reset(seed=7)
        nothing = (np.zeros(count), *np.zeros((2, count), bool))
        streams = [[result(observations, nothing, infos, number)] for number in range(count)]
        for each in chosen:
            observations, *others, infos = envs.step(each)
            for number in range(count):
                streams[number].append(result(observations, tuple(others), infos, number))
        return streams
    finally:
        envs.close()


def in_any_order(envs: HouseholdAsyncEnv, chosen: np.ndarray) -> list[list[Any]]:
    """What each environment answers to the same actions, whenever it is ready; some answer more."""
    steps, count, _ = chosen.shape
    streams: list[list[Any]] = [[] for _ in range(count)]
    envs.async_reset(seed=7)
    while min(map(len, streams)) <= steps:
        observations, *others, infos = envs.recv()
        ids = infos["env_id"].tolist()
        assert ids == sorted(set(ids)) and len(ids) == envs.batch_size
        for index, number in enumerate(ids):
            streams[number].append(result(observations, tuple(others), infos, index))
        envs.send([chosen[(len(streams[number]) - 1) % steps, number] for number in ids], ids)
    return [stream[: steps + 1] for stream in streams]


@EVERYWHERE
@pytest.mark.parametrize("batch_size", [3, *(pytest.param(size, marks=pytest.mark.slow) for size in (1, COUNT))])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_each_environment_answers_as_in_lockstep(
    make: Make, workers: int, batch_size: int, mode: AutoresetMode
) -> None:
    chosen = np.random.default_rng(0).integers(0, SAFE, (20, COUNT, 2))
    wanted = in_lockstep(chosen, workers=0, autoreset_mode=mode)
    assert same(in_any_order(make(batch_size, workers, autoreset_mode=mode), chosen), wanted)


def test_homes_answer_as_in_lockstep(make: Make) -> None:
    chosen = np.random.default_rng(0).integers(0, (10, 9), (9, 3, 2))
    assert same(in_any_order(make(2, count=3, **HOMES), chosen), in_lockstep(chosen, workers=1, **HOMES))


def test_a_batch_has_the_infos_of_its_environments_alone(make: Make) -> None:
    envs = make(COUNT)
    envs.async_reset(seed=7)
    whole = vector_env(COUNT, ToyEnv, 0)
    observations, infos = whole.reset(seed=7)
    whole.close()
    ours = envs.recv()
    assert same(ours[0], observations)
    assert same({key: value for key, value in ours[4].items() if key != "env_id"}, infos)


def test_spaces(make: Make) -> None:
    envs = make(3, workers=0)
    assert (envs.num_envs, envs.batch_size, envs.render_mode) == (COUNT, 3, "rgb_array")
    assert envs.observation_space == batch_space(envs.single_observation_space, 3)
    assert envs.action_space == batch_space(envs.single_action_space, 3)
    assert envs.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    envs.async_reset()
    observations, *_, infos = envs.recv()
    assert observations in envs.observation_space
    assert len(envs.step(np.zeros((3, 2), int), infos["env_id"])[1]) == 3


def test_environments_of_this_process_are_not_forgotten(make: Make) -> None:
    envs = make(1)
    envs.async_reset(seed=0)
    received = np.zeros(COUNT, int)
    for _ in range(60):
        number = envs.recv()[4]["env_id"]
        received[number] += 1
        time.sleep(0.001)  # a learner at work, during which the worker is always ready first
        envs.send([[0, 0]], number)
    assert received.min() >= 60 // (2 * COUNT)


@EVERYWHERE
def test_questions_are_answered_after_what_was_begun(make: Make, workers: int) -> None:
    envs = make(2, workers)
    envs.async_reset(seed=10)
    assert envs.call("whoami", greeting="seed ") == tuple(f"seed {10 + number}" for number in range(COUNT))
    envs.set_attr("mood", "glad")
    assert envs.get_attr("mood") == ("glad",) * COUNT
    with pytest.raises(AttributeError):
        envs.get_attr("nothing")
    received = [number for _ in range(2) for number in envs.recv()[4]["env_id"]]
    assert len(set(received)) == 4, "the resets are still answered"


def test_a_full_pipe_holds_nobody_up(make: Make) -> None:
    envs = make(1, env_id=Talkative)
    pool = envs._pool
    for pipe in (pool._commands[0], pool._answers[0]):
        fcntl.fcntl(pipe.fileno(), fcntl.F_SETPIPE_SZ, 4096)
    envs.async_reset(seed=0)
    for _ in range(COUNT):
        envs.recv()
    for _ in range(10):
        for number in range(COUNT):
            envs.send([[0, 0]], [number])
        assert sorted(int(envs.recv()[4]["env_id"][0]) for _ in range(COUNT)) == list(range(COUNT))


class Talkative(ToyEnv):
    """A toy whose answers fill a pipe."""

    def _info(self, over: bool) -> dict[str, Any]:
        return {"essay": os.urandom(10_000)}


def test_what_is_not_there_cannot_be_sent_or_received(make: Make) -> None:
    envs = make(2, workers=0)
    with pytest.raises(NoAsyncCallError, match="0 environments are under way, fewer than 2"):
        envs.recv()
    envs.async_reset(seed=0)
    with pytest.raises(AlreadyPendingCallError):
        envs.async_reset()
    ids = envs.recv()[4]["env_id"]
    others = [number for number in range(COUNT) if number not in ids]
    with pytest.raises(AlreadyPendingCallError, match="under way"):
        envs.send([[0, 0]], others[:1])
    for wrong in ([-1], [COUNT], [0, 0], [], [0.5], 0, "x", [[0]]):
        with pytest.raises(OptionError, match="env_id"):
            envs.send([[0, 0]], wrong)  # type: ignore[arg-type]
    for actions in ([[0, 0]], np.zeros((2, 2)), "go", [[0, 0], [0]]):
        with pytest.raises(ActionError):
            envs.send(actions, ids)
    with pytest.raises(OptionError, match="seeds"):
        make(2, workers=0).async_reset(seed=[1, 2])
    envs.send([[0, 0], [0, 0]], ids)


@pytest.mark.parametrize(
    "wrong",
    [{"batch_size": 0}, {"batch_size": COUNT + 1}, {"batch_size": True}, {"autoreset_mode": "Disabled"},
     {"copy": False}, {"backend": "ray"}],
)  # fmt: skip
def test_wrong_arguments_are_refused(make: Make, wrong: dict[str, Any]) -> None:
    with pytest.raises(OptionError, match="batch_size"):
        make(**{"batch_size": 2, "workers": 0, **wrong})


def test_gymnasium_makes_none() -> None:
    with pytest.raises(OptionError, match=r"chmarl_pb\.vector_env"):
        chmarl_pb.envs.vector.env.joint_vector_env(2, batch_size=1)


def test_copies_are_refused(make: Make) -> None:
    with pytest.raises(CopyError, match=r"HouseholdAsyncEnv .*make another by vector_env"):
        make(workers=0).__reduce__()


def harmed(envs: HouseholdAsyncEnv, number: int, action: int) -> None:
    """Reset all environments, and let one do harm."""
    envs.async_reset(seed=0)
    left = COUNT
    while left:
        ids = envs.recv()[4]["env_id"].tolist()
        left -= len(ids)
    envs.send([[action, 0]], [number])
    envs.recv()


@pytest.mark.parametrize("number", [0, COUNT - 1], ids=["in-process", "in-workers"])
def test_an_error_closes_all(make: Make, number: int) -> None:
    envs = make(1)
    (process,) = envs._pool._processes
    with pytest.raises(ActionError, match="action 3 is not allowed") as raised:
        harmed(envs, number, FAIL)
    assert isinstance(raised.value.__cause__, WorkerTraceback) == (number > 0)
    assert process.exitcode is not None
    with pytest.raises(ClosedEnvironmentError):
        envs.async_reset()
    with pytest.raises(ClosedEnvironmentError):
        envs.send([[0, 0]], [0])
    with pytest.raises(ClosedEnvironmentError):
        envs.recv()
    envs.close()


def test_a_dead_worker_closes_all(make: Make) -> None:
    with pytest.raises(WorkerError, match=r"environments 2 to 4 died \(exit code 7"):
        harmed(make(1), COUNT - 1, DIE)
    envs = make(COUNT)
    os.kill(envs._pool._processes[0].pid or 0, signal.SIGKILL)
    with pytest.raises(WorkerError, match=r"environments 2 to 4 died \(exit code -9"):
        envs.async_reset()
        envs.recv()
