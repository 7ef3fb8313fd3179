"""Mutated files of every kind that strangers may send are read, or refused with one message: see ``run.py``.

20 cases of some kinds here and now; ``make test-slow`` plays 1,000 of each.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.hostile.kinds import kinds

pytest.importorskip("torch")
ROOT = Path(__file__).parents[2]
KINDS = tuple(kinds(1))
QUICK = ("home", "obj", "stl", "dae", "catalogue", "task", "audit")  # the others begin with seconds of making a file


def ends(cases: int, *names: str) -> list[dict[str, object]]:
    """Return how the cases of some kinds ended."""
    command = [sys.executable, "-m", "tests.hostile.run", *names, "--cases", str(cases)]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    found = [json.loads(line) for line in done.stdout.splitlines() if line.startswith("{")]
    assert len(found) == len(names), done.stderr
    return found


def test_some_mutated_files_end_in_a_message_or_are_read() -> None:
    found = ends(20, *QUICK)
    assert not [(end["kind"], end["bad"]) for end in found if end["bad"]]
    assert all(end.get("refused") for end in found)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
def test_a_thousand_mutated_files_end_in_a_message_or_are_read(kind: str) -> None:
    (found,) = ends(1000, kind)
    assert not found["bad"] and found.get("refused") and found.get("loads")


def test_the_watch_sees_what_must_not_happen(tmp_path: Path) -> None:
    """A reader that opens the secret, runs code, hangs or dies is told apart from one that reads."""
    script = """
import os, sys, tempfile
from pathlib import Path
from tests.hostile import kinds, watch
watch.SECONDS = 1
root = Path(sys.argv[1]); (root / "secret.obj").write_text(""); (root / "case").mkdir()
os.environ |= {"CHMARL_CACHE": str(root / "cache"), "TMPDIR": str(root / "cache")}
def spies(folder): open(folder.parent / "secret.obj").read()
def runs(folder): os.system("true")
def hangs(folder):
    while True: pass
def dies(folder): os.abort()
def fails(folder): raise KeyError("x")
def fills(folder): bytearray(3 * 2**30)
def reads(folder): (folder / "x").write_text("x")
worker = watch.Worker(watch.Guard(), watch.Openings(root / "secret.obj"))
for load in (spies, runs, hangs, dies, fails, fills, reads):
    setattr(kinds, load.__name__, load)
for load in (spies, runs, hangs, dies, fails, fills, reads):
    end = worker.end_of(load, root / "case")
    print(load.__name__, end.outcome, end.is_good, len(end.deeds))
worker.close()
"""
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path)], cwd=ROOT, capture_output=True, text=True, check=False
    )
    assert done.stdout.splitlines() == [
        "spies loads False 2", "runs loads False 1", "hangs hang False 0", "dies crash False 0",
        "fails traceback False 0", "fills memory False 0", "reads loads True 0",
    ], done.stderr  # fmt: skip
