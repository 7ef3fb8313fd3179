"""Evaluations by real processes that are ended in hard ways, and that others would like to join."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from chmarl_pb.cli import main
from chmarl_pb.evaluation.result import load_result
from chmarl_pb.tasks.splits import load_tasks
from tests.test_processes import gone

ROOT = Path(__file__).parents[2]
TASKS = [task.id for task in load_tasks("test-unseen")[:4]]
POLICY = """
import os, time
from functools import partial
from chmarl_pb.policies.registry import make_policy

class Slow:
    def __init__(self, env):
        self.inner, self.reset = make_policy("random", env), lambda seed: self.inner.reset(seed)

    def act(self, observations, infos):
        time.sleep(float(os.environ.get("PAUSE", "0")))
        return self.inner.act(observations, infos)
"""


def children(pid: int) -> list[int]:
    """Return the processes that a process has started."""
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.parametrize("number", [pytest.param(signal.SIGKILL, marks=pytest.mark.slow), signal.SIGTERM])
def test_ended_evaluation_leaves_no_process_and_goes_on_with_each_episode_once(
    number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "slow.py").write_text(POLICY)
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    out = tmp_path / "result.json"
    command = ["evaluate", "--policy", "slow:Slow", "--seeds", "2", "--max-steps", "6", "--workers", "2"]
    command += [word for task in TASKS for word in ("--task", task)] + ["--out", str(out)]
    process = subprocess.Popen(
        [sys.executable, "-m", "chmarl_pb.cli", *command], stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT), "PAUSE": "0.3"},
    )  # fmt: skip
    partial, deadline = tmp_path / "result.json.partial", time.monotonic() + 200
    while not (partial.is_file() and len(partial.read_text().splitlines()) > 2):
        assert time.monotonic() < deadline and process.poll() is None
        time.sleep(0.05)
    assert main(command) == 2
    assert f"{out}: another process is writing it; wait until process {process.pid}" in capsys.readouterr().err
    workers = children(process.pid)
    process.send_signal(number)
    assert process.wait(timeout=60) == (143 if number == signal.SIGTERM else -number)
    assert len(workers) >= 2 and gone(workers)
    assert "Traceback" not in process.communicate()[1]
    kept = len(partial.read_text().splitlines()) - 1
    assert 2 <= kept < 8 and not out.exists()
    assert main([*command, "--workers", "1"]) == 0
    jobs = [episode.job for episode in load_result(out).episodes]
    assert len(jobs) == len(set(jobs)) == 8 and not partial.exists()
