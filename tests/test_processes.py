"""No process outlives the one that started it, a dead one is an error that keeps what is finished."""

import ast
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Collection, Generator
from multiprocessing import active_children
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb import processes
from chmarl_pb.errors import OptionError, WorkerError
from chmarl_pb.processes import in_processes, meanwhile

PACKAGE = Path(__file__).parents[1]
pytestmark = pytest.mark.usefixtures("spawned")


def square(number: int) -> int:
    time.sleep(0.02 * (3 - number % 3))
    return number * number


def die_at(number: int) -> int:
    if number == 5:
        time.sleep(0.5)
        os.kill(os.getpid(), signal.SIGKILL)
    return number


def dawdle(seconds: float) -> int:
    time.sleep(seconds)
    return os.getpid()


def test_results_come_in_order_if_that_is_wanted() -> None:
    assert list(in_processes(square, range(9), 2, ordered=True)) == [number**2 for number in range(9)]
    assert sorted(in_processes(square, range(9), 2)) == [number**2 for number in range(9)]
    assert list(in_processes(square, [], 2)) == []
    with pytest.raises(OptionError, match="workers=0 is not a whole number from 1"):
        list(in_processes(square, [1], 0))


@pytest.mark.parametrize("ordered", [True, False])
def test_a_dead_process_is_an_error_after_all_that_was_finished(ordered: bool) -> None:
    found = []
    with pytest.raises(WorkerError, match="died"):
        for number in in_processes(die_at, range(6), 2, ordered):
            found.append(number)
    assert sorted(found) == [0, 1, 2, 3, 4]


def die() -> None:
    os.kill(os.getpid(), signal.SIGKILL)


def fail() -> None:
    raise ValueError("in the other process")


def sleep_long() -> None:
    time.sleep(600)


@pytest.mark.parametrize("work", [os.getpid, fail, die])
def test_what_is_done_meanwhile_brings_nothing_not_even_an_error(work: Callable[[], object]) -> None:
    before = children()
    with meanwhile(work):
        pass
    assert gone(children() - before)


def test_what_is_done_meanwhile_ends_with_what_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_PATIENCE", 0.2)
    before = children()
    with pytest.raises(KeyError), meanwhile(sleep_long):
        raise KeyError("here")
    assert gone(children() - before)


def test_processes_at_work_end_soon_when_nobody_waits_for_them(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(processes, "_PATIENCE", 0.2)
    results = in_processes(dawdle, [0.0, 0.0, 600.0, 600.0], 2)
    pids = {next(results), next(results)}
    start = time.monotonic()
    assert isinstance(results, Generator)
    results.close()
    assert time.monotonic() - start < 20
    assert gone(pids)


def test_no_memory_for_semaphores_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(processes, "ProcessPoolExecutor", refuse)
    with pytest.raises(WorkerError, match="no process can be started"):
        list(in_processes(square, [1, 2], 2))


SCRIPT = """
import os, time
from chmarl_pb.processes import in_processes

def work(number):
    os.write(1, f"{os.getpid()}\\n".encode())  # at once: lines of two processes do not mix
    time.sleep(600)

if __name__ == "__main__":
    list(in_processes(work, [0, 1], 2))
"""


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGTERM, signal.SIGHUP])
def test_processes_end_with_their_parent_however_it_ends(tmp_path: Path, number: int) -> None:
    script = tmp_path / "script.py"
    script.write_text(SCRIPT)
    parent = subprocess.Popen([sys.executable, str(script)], stdout=subprocess.PIPE, cwd=PACKAGE, text=True)
    assert parent.stdout is not None
    pids = [int(parent.stdout.readline()) for _ in range(2)]
    parent.send_signal(number)
    assert parent.wait(timeout=60) == -number
    assert gone(pids)
    parent.stdout.close()


def children() -> set[int]:
    """Return the processes that this one started, some of which may have ended."""
    return {process.pid for process in active_children() if process.pid is not None}


def gone(pids: Collection[int], patience: float = 30) -> bool:
    """Return whether processes end within some seconds."""
    deadline = time.monotonic() + patience
    while time.monotonic() < deadline and any(map(is_running, pids)):
        time.sleep(0.05)
    return not any(map(is_running, pids))


def is_running(pid: int) -> bool:
    """Return whether a process has not ended."""
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except (FileNotFoundError, ProcessLookupError):
        return False
    return state != "Z"


def test_there_is_one_pool() -> None:
    """Whoever starts processes in another way has to see for himself to it that they end."""
    alone = {"processes.py", "envs/vector/engine.py", "bench/fresh.py"}
    for path in (PACKAGE / "chmarl_pb").rglob("*.py"):
        if path.relative_to(PACKAGE / "chmarl_pb").as_posix() in alone:
            continue
        named = set[str]()
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Import | ast.ImportFrom):
                module = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
                named |= {f"{module}{name.name}" for name in node.names}
        named -= {"concurrent.futures.Future", "concurrent.futures.wait"}  # between threads
        named -= {"multiprocessing.connection.Connection", "concurrent.futures.Executor"}  # types
        assert not any(name.startswith(("subprocess", "multiprocessing", "concurrent")) for name in named), path
