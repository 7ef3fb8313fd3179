"""The processes of a vector of environments: their errors and deaths, and that nothing of them stays behind."""

import gc
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.error import ClosedEnvironmentError
from hypothesis import given
from hypothesis import strategies as st

import chmarl_pb
from chmarl_pb.envs.vector.engine import WorkerTraceback, shares
from chmarl_pb.envs.vector.env import HouseholdVectorEnv, vector_env
from chmarl_pb.errors import ActionError, OptionError, WorkerError
from tests.helpers.toy_env import DIE, FAIL, ToyEnv
from tests.helpers.toy_vectors import COUNT, EVERYWHERE

pytestmark = pytest.mark.usefixtures("spawned")


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


class Held:
    """A sensor with what cannot be pickled, or says so in a way of its own."""

    def __init__(self, error: Exception | None = None):
        self.lock, self.error = threading.Lock(), error

    def __getstate__(self) -> Any:
        if self.error:
            raise self.error
        return vars(self)

    def spaces(self) -> dict[str, Any]:
        return {"held": spaces.Box(0, 1, (1,), np.float32)}

    def observe(self, view: Any) -> dict[str, Any]:
        return {"held": np.zeros(1, np.float32)}


@pytest.mark.parametrize(
    ("observation", "reason"),
    [
        (Held(), "cannot pickle '_thread.lock' object"), (("scene_graph", Held()), "cannot pickle"),
        (Held(RuntimeError("not to be\ncopied")), r"\(not to be copied\)"), (Held(KeyError()), r"\(KeyError\)"),
    ],
)  # fmt: skip
@pytest.mark.parametrize("more", [{}, {"batch_size": 2}])
def test_what_cannot_be_sent_to_workers_is_told(observation: Any, reason: str, more: dict[str, Any]) -> None:
    words = rf"^the environment cannot be sent to other processes, as observation={__name__}:Held holds what cannot be "
    with pytest.raises(OptionError, match=rf"{words}pickled .*{reason}.*; keep .*, or give workers=1$"):
        vector_env(4, observation=observation, workers=2, **more)
    assert not multiprocessing.active_children()
    lock = threading.Lock()
    with pytest.raises(OptionError, match=r"^the environment cannot be sent to other processes \(cannot pickle"):
        vector_env(4, lambda: (lock, ToyEnv())[1], workers=2)


def test_in_one_process_nothing_is_sent() -> None:
    lock = threading.Lock()
    with closing(vector_env(2, lambda: (lock, ToyEnv())[1], workers=1)) as env:
        assert env.reset(seed=0)


def harm(action: int) -> np.ndarray:
    """Actions of which the last environment's is harmful."""
    return np.array([[0, 0]] * (COUNT - 1) + [[action, 0]])


@pytest.fixture
def env() -> Iterator[HouseholdVectorEnv]:
    """Environments 0 and 1 in this process, 2 to 4 in a worker."""
    with closing(vector_env(COUNT, ToyEnv, 2)) as env:
        env.reset(seed=0)
        yield env


def test_error_in_a_worker(env: HouseholdVectorEnv) -> None:
    running = pids(env)
    with pytest.raises(ActionError, match="action 3 is not allowed") as raised:
        env.step(harm(FAIL))
    assert isinstance(raised.value.__cause__, WorkerTraceback)
    assert "toy_env.py" in str(raised.value.__cause__)
    assert "[2, 3, 4]" in str(raised.value.__cause__)
    assert all(map(gone, running))
    with pytest.raises(ClosedEnvironmentError):
        env.reset()
    env.close()


@EVERYWHERE
def test_error_in_this_process(workers: int) -> None:
    with closing(vector_env(COUNT, ToyEnv, workers)) as env:
        env.reset(seed=0)
        running = pids(env)
        with pytest.raises(ActionError, match="action 3 is not allowed"):
            env.step(harm(FAIL)[::-1])
        assert all(map(gone, running))
        with pytest.raises(ClosedEnvironmentError):
            env.reset()


def test_death_of_a_worker(env: HouseholdVectorEnv) -> None:
    running = pids(env)
    with pytest.raises(WorkerError, match=r"environments 2 to 4 died \(exit code 7"):
        env.step(harm(DIE))
    assert all(map(gone, running))
    with pytest.raises(ClosedEnvironmentError):
        env.step(harm(0))


@pytest.mark.parametrize("deadly", [signal.SIGTERM, signal.SIGKILL], ids=lambda number: number.name)
def test_worker_killed_between_steps(env: HouseholdVectorEnv, deadly: signal.Signals) -> None:
    os.kill(pids(env)[0], deadly)
    with pytest.raises(WorkerError, match=rf"environments 2 to 4 died \(exit code -{deadly.value}"):
        for _ in range(3):
            env.step(harm(0))


def test_a_worker_leaves_ctrl_c_to_its_parent(env: HouseholdVectorEnv) -> None:
    os.kill(pids(env)[0], signal.SIGINT)
    for _ in range(3):
        env.step(harm(0))


def test_what_cannot_travel_harms_nothing(env: HouseholdVectorEnv) -> None:
    with pytest.raises((AttributeError, TypeError, pickle.PicklingError)):
        env.call("whoami", greeting=lambda: None)
    with pytest.raises((AttributeError, TypeError, RuntimeError, pickle.PicklingError)):
        env.call("secret")
    env.step(harm(0))


@EVERYWHERE
def test_error_at_the_start(workers: int) -> None:
    with pytest.raises(OptionError, match="is broken"):
        vector_env(COUNT, partial(ToyEnv, broken=True), workers)


def test_error_at_the_start_of_a_worker() -> None:
    with pytest.raises(OptionError, match="is broken"):
        vector_env(2, partial(broken_elsewhere, os.getpid()), 2)


def test_environments_of_a_worker_have_the_spaces_of_those_here() -> None:
    with pytest.raises(OptionError, match=r"key 'picture': None in environment 1, Box.* in environment 0"):
        vector_env(2, partial(blind_elsewhere, os.getpid()), 2)


def blind_elsewhere(parent: int) -> gymnasium.Env:
    """A toy in the process that makes the vector, one without pictures in any other."""
    return ToyEnv() if os.getpid() == parent else gymnasium.wrappers.FilterObservation(ToyEnv(), ["self"])


def broken_elsewhere(parent: int) -> ToyEnv:
    """A toy in the process that makes the vector, an error in any other."""
    return ToyEnv(broken=os.getpid() != parent)


def test_close_and_garbage_collection() -> None:
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
from tests.helpers.toy_env import ToyEnv
from chmarl_pb.envs.vector.env import vector_env
if __name__ == "__main__":
    env = vector_env(3, ToyEnv, 3)
    env.reset(seed=0)
    print(*(process.pid for process in env._engine._processes), flush=True)
    while True:
        env.step([[0, 0], [1, 1], [2, 0]])
"""


@pytest.mark.parametrize("deadly", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL], ids=lambda number: number.name)
def test_nothing_is_left_behind(tmp_path: Path, deadly: signal.Signals) -> None:
    path = tmp_path / "script.py"
    path.write_text(SCRIPT)
    search = os.pathsep.join([str(Path(__file__).parent), str(Path(chmarl_pb.__file__).parents[1])])
    with subprocess.Popen(
        [sys.executable, str(path)], env={**os.environ, "PYTHONPATH": search}, text=True, start_new_session=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    ) as script:  # fmt: skip
        assert script.stdout is not None
        running = [int(word) for word in script.stdout.readline().split()]
        (os.killpg if deadly is signal.SIGINT else os.kill)(script.pid, deadly)  # Ctrl-C goes to workers as well
        _, errors = script.communicate(timeout=20)
    assert len(running) == 2
    assert all(map(gone, running))
    assert "leaked" not in errors
    assert errors.count("Traceback") == (deadly is signal.SIGINT)
    end = time.monotonic() + 5  # other tests may just be starting workers
    while left := list(Path("/dev/shm").glob("chmarl-pb-*")):
        assert time.monotonic() < end, left
        time.sleep(0.05)


@given(count=st.integers(1, 200), processes=st.integers(1, 16))
def test_shares_are_consecutive_and_nearly_equal(count: int, processes: int) -> None:
    processes = min(count, processes)
    parts = shares(count, processes)
    assert [number for part in parts for number in part] == list(range(count)) and all(parts)
    assert len(parts[0]) == min(map(len, parts)) and max(map(len, parts)) - len(parts[0]) <= 2 + count // 8
