"""What policies of one file of weights score: printed and kept, or refused in one sentence."""

import json
import subprocess
import sys
from pathlib import Path

from chmarl_pb.files import file_hash
from chmarl_pb.policies.weights import weights_folder

WEIGHTS = weights_folder() / "ours-graphs.pt"


def directions(*options: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "benchmarks.directions", *options]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_scores_are_printed_and_kept(tmp_path: Path) -> None:
    kept = tmp_path / "new" / "scores.json"
    options = ("--split", "val-unseen", "--thin", "25", "--workers", "1", "--no-feedback", "--json", str(kept))
    done = directions(str(WEIGHTS), *options)
    assert done.returncode == 0, done.stderr
    content = json.loads(kept.read_text())
    assert content["weights_sha256"] == file_hash(WEIGHTS)
    assert content["rules"] == {"messages": True, "feedback": False}
    assert [(row["row"], row["split"], row["tasks"]) for row in content["rows"]] == [
        (name, "val-unseen", 2) for name in ("told", "zeros")
    ]
    printed = [line.split(" | ") for line in done.stdout.splitlines()[2:]]
    means = [f"{100 * row[metric]:.1f}" for row in content["rows"] for metric in ("success_rate", "plw")]
    assert [cell for line in printed for cell in line[3:5]] == means


def test_weights_that_are_not_there_are_one_sentence(tmp_path: Path) -> None:
    done = directions(str(tmp_path / "none.pt"))
    assert done.returncode == 2 and "no such checkpoint" in done.stderr and "Traceback" not in done.stderr
