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
from chmarl_pb.signals import Interrupted, handled
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


#: Stops the import of a module until a signal comes, and says so.
SLOW = """
import os, sys, time

class Slow:
    def find_spec(self, name, path=None, target=None):
        if name == os.environ.get("SLOW_MODULE"):
            print("importing", flush=True)
            time.sleep(60)

sys.meta_path.insert(0, Slow())
"""

SCRIPT = "import sys; from chmarl_pb.cli import main; sys.exit(main())"  # as pip writes it


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM], ids=lambda number: number.name)
@pytest.mark.parametrize(
    ("module", "words"),
    [
        ("gymnasium", ["-m", "chmarl_pb", "homes", "list"]),
        ("chmarl_pb.cli.arguments", ["-m", "chmarl_pb.cli", "homes", "list"]),
        ("gymnasium", ["chmarl-pb", "homes", "list"]),
        ("chmarl_pb.cli.homes", ["chmarl-pb", "homes", "list"]),
        ("torch", ["-m", "training.train", "--algo", "qmix"]),
        ("stable_baselines3", ["-m", "training.sb3", "--algo", "ppo"]),
        ("torch", ["-m", "training.table", "--show"]),
        ("torch", ["-m", "training.pretrain"]),
    ],
    ids=lambda value: value if isinstance(value, str) else value[1],
)
def test_an_interrupt_is_one_line_though_modules_are_still_imported(
    module: str, words: list[str], number: signal.Signals, tmp_path: Path
) -> None:
    (tmp_path / "sitecustomize.py").write_text(SLOW)
    (tmp_path / "chmarl-pb").write_text(SCRIPT)
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    process = subprocess.Popen(
        [sys.executable, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths, "SLOW_MODULE": module},
    )  # fmt: skip
    assert process.stdout and process.stdout.readline() == "importing\n"
    process.send_signal(number)
    _, said = process.communicate(timeout=60)
    lines = [line for line in said.splitlines() if not line.endswith("loading PyTorch")]
    assert process.returncode == 128 + number and len(lines) == 1, said
    assert ("interrupted" if number == signal.SIGINT else "ended by SIGTERM") in lines[0]


def test_programs_of_others_handle_their_interrupts_themselves(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(SLOW)
    package = tmp_path / "mine"
    package.mkdir()
    (package / "__init__.py").write_text("try: import chmarl_pb\nexcept KeyboardInterrupt: print('mine', flush=True)\n")
    (package / "run.py").write_text("print('goes on')\n")
    process = subprocess.Popen(
        [sys.executable, "-m", "mine.run"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)]), "SLOW_MODULE": "gymnasium"},
    )  # fmt: skip
    assert process.stdout and process.stdout.readline() == "importing\n"
    process.send_signal(signal.SIGINT)
    assert process.communicate(timeout=60) == ("mine\ngoes on\n", "")


def test_what_a_library_makes_of_an_interrupt_is_an_interrupt() -> None:
    with pytest.raises(Interrupted), handled():
        try:
            signal.raise_signal(signal.SIGTERM)
        except KeyboardInterrupt as error:
            raise ImportError("numpy.core.multiarray failed to import") from error


def test_processes_that_are_started_do_not_hear_interrupts_as_they_import(tmp_path: Path) -> None:
    (tmp_path / "sitecustomize.py").write_text(SLOW)
    script = tmp_path / "script.py"
    script.write_text(
        "import os\n"
        "from chmarl_pb.processes import in_processes\n"
        "if __name__ == '__main__':\n"
        "    os.environ['SLOW_MODULE'] = 'chmarl_pb'\n"
        "    print(list(in_processes(abs, [-1], 1)))\n"
    )
    process = subprocess.Popen(
        [sys.executable, str(script)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])},
    )  # fmt: skip
    try:
        assert process.stdout and process.stdout.readline() == "importing\n"
        for pid in children(process.pid):
            os.kill(pid, signal.SIGINT)
        time.sleep(1)
        assert process.poll() is None
    finally:
        process.kill()
        said = process.communicate(timeout=60)[1]
    assert "Traceback" not in said
