"""Interrupted trainings: saved at once, one line, no traceback, and the same numbers in the end."""

import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import torch

from chmarl_pb.learning import train
from chmarl_pb.learning.runs.interrupts import Signals, run_command
from chmarl_pb.learning.runs.logger import METRICS, read_rows
from chmarl_pb.learning.runs.run import BEST, LAST, Run
from chmarl_pb.learning.runs.validation import by_return
from chmarl_pb.learning.storage.checkpoint import load
from chmarl_pb.learning.threads import threads
from chmarl_pb.signals import Interrupted
from tests.helpers.small_runs import CONFIGS, EXPERT, SMALL
from tests.helpers.stopping import in_pieces
from tests.helpers.uneven_env import UnevenEnv
from tests.helpers.warm_python import WarmPython

torch.set_num_threads(1)  # these networks are too small for more


def assert_same(one: Path, other: Path) -> None:
    """Compare two finished runs."""
    rows = [[{**row, "speed": 0} for row in read_rows(folder / METRICS)] for folder in (one, other)]
    assert rows[0] == rows[1] and len(rows[0]) == 6
    for name, key in ((LAST, "learner"), (BEST, "agents")):
        weights = [load(folder / name)[key] for folder in (one, other)]
        states = [part["networks"] if key == "learner" else part for part in weights]
        assert all(torch.equal(states[0][part], states[1][part]) for part in states[0])


@pytest.mark.parametrize(("algorithm", "every"), [*((name, 13) for name in CONFIGS), ("vdn", 11), ("mappo", 19)])
def test_a_run_may_be_interrupted_anywhere(
    algorithm: str, every: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the middle of an episode, and of a validation, whose eight episodes take eight steps of all environments."""
    run = partial(train, UnevenEnv, algorithm, CONFIGS[algorithm], validate=by_return(8), expert=EXPERT)
    run(tmp_path / "whole")
    _, times = in_pieces(lambda: run(tmp_path / "pieces"), every, monkeypatch)
    assert times > 2
    assert_same(tmp_path / "whole", tmp_path / "pieces")


Process = subprocess.Popen[str] | WarmPython


def start(*arguments: str, warm: bool = True) -> Process:
    if warm:
        return WarmPython(("-m", *arguments))
    return subprocess.Popen(
        [sys.executable, "-m", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        env={**os.environ, "PYTHONPATH": os.getcwd()},
    )  # fmt: skip


def wait_for(process: Process, folder: Path, rows: int) -> None:
    """Wait until a run has written some rows of metrics."""
    metrics = folder / "metrics.jsonl"
    while not metrics.exists() or len(metrics.read_text().splitlines()) < rows:
        assert process.poll() is None, process.communicate()
        time.sleep(0.01)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_saves_and_the_same_command_ends_with_the_same_numbers(number: int, tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", SMALL, tmp_path / "whole")
    folder = tmp_path / "cut"
    process = start("tests.helpers.slow_run", "vdn", str(folder), warm=number == signal.SIGINT)
    wait_for(process, folder, 3)
    process.send_signal(number)
    out, known = process.communicate()
    episodes = load(folder / LAST)["episodes"]
    not_done = f"the same command goes on from {folder / LAST}: python -m tests.helpers.slow_run vdn {folder}"
    assert process.returncode == 128 + number and not out
    assert known == f"interrupted after {episodes} episodes; {not_done}\n"
    assert episodes >= 24
    train(UnevenEnv, "vdn", SMALL, folder)
    assert_same(tmp_path / "whole", folder)


def test_a_killed_run_loses_no_more_than_is_allowed(tmp_path: Path) -> None:
    """Here nothing but the present rollout; checkpoints by time change no numbers."""
    train(UnevenEnv, "vdn", SMALL, tmp_path / "whole")
    folder = tmp_path / "cut"
    process = start("tests.helpers.slow_run", "vdn", str(folder), "0")
    wait_for(process, folder, 3)
    process.kill()
    process.communicate()
    assert load(folder / LAST)["episodes"] >= 20  # by the interval it would be 16
    (folder / ".last.pt-half.tmp").write_bytes(b"PK")  # what is left of a checkpoint if it is killed while it writes it
    train(UnevenEnv, "vdn", SMALL, folder)
    assert_same(tmp_path / "whole", folder)
    assert not list(folder.rglob("*.tmp"))


def test_a_second_signal_ends_at_once_and_leaves_files_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    train(UnevenEnv, "vdn", SMALL, tmp_path / "whole")
    save, folder = Run.save, tmp_path / "cut"

    def save_slowly(run: Run) -> None:
        save(run)
        if run.episodes == 24:
            for _ in range(2):
                os.kill(os.getpid(), signal.SIGINT)
            raise AssertionError("the second signal did not end it")

    def reported(run: Run, before: int, logger: Any) -> None:
        run.save()
        report(run, before, logger)

    report = Run._report
    with monkeypatch.context() as patch, pytest.raises(Interrupted) as caught:
        patch.setattr(Run, "save", save_slowly)
        patch.setattr(Run, "_report", reported)
        train(UnevenEnv, "vdn", SMALL, folder)
    assert caught.value.number == signal.SIGINT
    assert not list(folder.glob("*.tmp")) and not list(folder.glob(".*.tmp"))
    train(UnevenEnv, "vdn", SMALL, folder)
    assert_same(tmp_path / "whole", folder)


def test_signals_are_given_back_and_ignored_ones_stay_ignored() -> None:
    before = signal.getsignal(signal.SIGTERM)
    with Signals() as signals:
        os.kill(os.getpid(), signal.SIGTERM)
        assert signals.number == signal.SIGTERM
    assert signal.getsignal(signal.SIGTERM) is before
    interrupt = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        with Signals() as signals:
            os.kill(os.getpid(), signal.SIGINT)
            assert signals.number is None
    finally:
        signal.signal(signal.SIGINT, interrupt)


def test_commands_that_wait_for_nobody_end_by_a_signal_with_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    def stopped(number: int) -> int:
        os.kill(os.getpid(), number)
        return 0

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        code = run_command(partial(stopped, number))
        known = capsys.readouterr().err
        assert (
            code == 128 + number
            and known.startswith("interrupted; the same command goes on")
            and "\n" not in known[:-1]
        )


def test_threads_of_torch_are_set_while_a_training_runs_and_then_given_back() -> None:
    seen = []

    class Env(UnevenEnv):
        def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
            seen.append(torch.get_num_threads())
            return super().step(actions)

    with threads(2):
        train(Env, "vdn", SMALL)
        assert set(seen) == {1} and torch.get_num_threads() == 2
        seen.clear()
        with pytest.raises(ValueError, match="horizon"):
            train(partial(UnevenEnv, 10**9), "vdn", SMALL, threads=3)
        assert torch.get_num_threads() == 2
    with pytest.raises(ValueError, match="threads=0"):
        train(UnevenEnv, "vdn", SMALL, threads=0)
