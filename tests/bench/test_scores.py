"""What policies of one file of weights score: printed and kept, or refused in one sentence."""

import importlib
import json
import subprocess
import sys
from pathlib import Path

import pytest

from benchmarks.scores import thinned
from chmarl_pb.files import file_hash
from chmarl_pb.learning.runs.validation import spread_tasks
from chmarl_pb.policies.weights import weights_folder
from chmarl_pb.tasks.splits import load_tasks

WEIGHTS = weights_folder() / "ours-grounded.pt"


def directions(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "benchmarks.directions", *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_scores_are_printed_and_kept(tmp_path: Path) -> None:
    kept = tmp_path / "new" / "scores.json"
    options = ("--thin", "100", "--workers", "1", "--no-feedback", "--json", str(kept))
    done = directions(str(WEIGHTS), *options)
    assert done.returncode == 0, done.stderr
    content = json.loads(kept.read_text())
    assert content["weights_sha256"] == file_hash(WEIGHTS)
    assert content["rules"] == {"track": "grounded", "feedback": False}
    told, zeros = content["rows"]
    assert [(row["row"], row["split"], row["tasks"]) for row in (told, zeros)] == [
        (name, "generated-val", 5) for name in ("told", "zeros")
    ]
    assert told | {"row": ""} != zeros | {"row": ""}, "directions are told in both"
    printed = [line.split(" | ") for line in done.stdout.splitlines()[2:]]
    means = [f"{100 * row[metric]:.1f}" for row in content["rows"] for metric in ("success_rate", "plw")]
    assert [cell for line in printed for cell in line[3:5]] == means


@pytest.mark.parametrize("every", [2, 5, 10])
def test_tasks_by_which_weights_are_chosen_are_left_out(every: int) -> None:
    tasks = load_tasks("generated-val")
    played = thinned(tasks, every)
    assert len(played) == len(tasks) // every
    assert not {task.id for task in played} & {task.id for task in spread_tasks("generated-val", 50)}


def test_of_few_tasks_one_is_played() -> None:
    tasks = load_tasks("val-unseen")
    assert thinned(tasks, 10**6) == [tasks[-1]] and thinned(tasks, 1) == list(tasks)


@pytest.mark.parametrize(
    ("module", "options", "words"),
    [
        ("directions", "none.pt", "no such checkpoint"),
        ("directions", f"{weights_folder() / 'ours-graphs.pt'}", "is told no directions"),
        ("directions", f"{WEIGHTS} --thin 0", "--thin=0 is not a whole number from 1 on"),
        ("directions", f"{WEIGHTS} --workers 0", "--workers=0 is not a whole number from 1 on"),
        ("directions", f"{WEIGHTS} --json .", "is a folder"),
    ],
)
def test_what_is_wrong_is_one_sentence(
    module: str,
    options: str,
    words: str,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr(sys, "argv", [module, *options.split()])
    assert importlib.import_module(f"benchmarks.{module}").main() == 2
    assert words in capsys.readouterr().err
