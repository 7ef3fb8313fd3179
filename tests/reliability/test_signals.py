"""Signals to real commands and to their workers: one message or recovery, nobody left, nothing finished lost."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.test_interruptions import children
from tests.test_processes import gone

ROOT = Path(__file__).parents[2]
TASKS = ("test-unseen-000", "test-unseen-001", "test-unseen-002", "test-unseen-003")
COMMANDS: dict[str, tuple[str, ...]] = {
    "evaluation": (
        "evaluate", "--policy", "random", *(word for task in TASKS for word in ("--task", task)), "--seeds", "12",
        "--workers", "2", "--out", "out/result.json",
    ),
    "audit": ("audit", "--split", "val-unseen", "--seeds", "1", "--workers", "2", "--out", "out/audit.json"),
    "data generation": (
        "dataset", "generate", "--split", "test-unseen", "--noise", "0.3", "--limit", "12", "--workers", "2",
        "--out", "out",
    ),
    "viewer": ("play", "--no-open", "--port", "0"),
}  # fmt: skip
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)


def start(folder: Path, name: str) -> "subprocess.Popen[str]":
    """Start a command in a folder."""
    return subprocess.Popen(
        [sys.executable, "-m", "chmarl_pb.cli", *COMMANDS[name]], cwd=folder, text=True, start_new_session=True,
        env={**os.environ, "PYTHONPATH": str(ROOT)}, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )  # fmt: skip


def finished(folder: Path) -> set[str]:
    """Return what is finished of a command: rows of side files and results, and files of episodes."""
    out = folder / "out"
    rows = {line for path in out.rglob("*.partial") for line in path.read_text().splitlines()[1:]}
    rows |= {
        json.dumps(row) for path in out.rglob("*.json") for row in json.loads(path.read_text()).get("episodes", [])
    }
    return rows | {path.name for path in out.rglob("*.hdf5")}


def await_work(process: "subprocess.Popen[str]", folder: Path, name: str) -> None:
    """Wait until something is finished, or the page is served."""
    if name == "viewer":
        assert process.stdout and process.stdout.readline().startswith("http://")
        return
    deadline = time.monotonic() + 400
    while len(finished(folder)) < 3:
        assert process.poll() is None and time.monotonic() < deadline, process.communicate()
        time.sleep(0.02)


@pytest.fixture
def running(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator["subprocess.Popen[str]"]:
    """A command at work."""
    process = start(tmp_path, request.param)
    try:
        await_work(process, tmp_path, request.param)
        yield process
    finally:
        process.kill()
        process.communicate()


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS, ids=lambda number: number.name)
@pytest.mark.parametrize("running", COMMANDS, indirect=True)
def test_a_command_ends_with_one_line_and_keeps_what_is_finished(
    running: "subprocess.Popen[str]", number: signal.Signals, tmp_path: Path
) -> None:
    workers, before = children(running.pid), finished(tmp_path)
    running.send_signal(number)
    _, said = running.communicate(timeout=120)
    assert running.returncode == (-number if number == signal.SIGKILL else 128 + number)
    lines = [line for line in said.splitlines() if line.startswith("chmarl-pb: ")]
    assert len(lines) == (number != signal.SIGKILL) and "Traceback" not in said, said
    assert gone(workers) and before <= finished(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("number", SIGNALS[1:], ids=lambda number: number.name)
@pytest.mark.parametrize("running", ["evaluation", "audit", "data generation"], indirect=True)
def test_a_worker_that_dies_is_one_message_and_the_command_goes_on_later(
    running: "subprocess.Popen[str]", number: signal.Signals, tmp_path: Path
) -> None:
    workers, before = children(running.pid), finished(tmp_path)
    names = {pid: Path(f"/proc/{pid}/cmdline").read_text() for pid in workers}
    os.kill(next(pid for pid, name in names.items() if "spawn_main" in name), number)
    _, said = running.communicate(timeout=120)
    assert running.returncode == 2 and "a process died" in said and "Traceback" not in said, said
    assert gone(workers) and before <= finished(tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("running", ["evaluation", "audit", "data generation"], indirect=True)
def test_a_second_command_in_the_folder_is_told_who_is_writing(
    running: "subprocess.Popen[str]", request: pytest.FixtureRequest, tmp_path: Path
) -> None:
    running.send_signal(signal.SIGSTOP)  # so that it does not end before the second begins
    second = start(tmp_path, request.node.callspec.params["running"])
    _, said = second.communicate(timeout=120)
    assert second.returncode == 2 and str(running.pid) in said and "Traceback" not in said, said


@pytest.mark.slow
@pytest.mark.parametrize("name", ["evaluation", "audit", "data generation"])
def test_what_is_ended_again_and_again_equals_what_never_was(name: str, tmp_path: Path) -> None:
    ends = []
    for folder, numbers in ((tmp_path / "whole", ()), (tmp_path / "cut", SIGNALS)):
        folder.mkdir()
        for number in numbers:
            process, before = start(folder, name), finished(folder)
            deadline = time.monotonic() + 300
            while finished(folder) <= before and process.poll() is None and time.monotonic() < deadline:
                time.sleep(0.02)
            process.send_signal(number)
            process.communicate(timeout=120)
        process = start(folder, name)
        _, said = process.communicate(timeout=600)
        assert process.returncode == 0, said
        if name == "evaluation":
            data = json.loads((folder / "out" / "result.json").read_text())
            ends.append((data["sha256"], data["episodes"]))
        elif name == "audit":
            ends.append(("", json.loads((folder / "out" / "audit.json").read_text())["rows"]))
        else:
            (path,) = (folder / "out").rglob("metadata.json")
            ends.append((json.loads(path.read_text())["sha256"], []))
    assert ends[0] == ends[1]
