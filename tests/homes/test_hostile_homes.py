"""Files that others made never end, stop or fill the process: each home is refused with one message, or it plays."""

import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.helpers.hostile_homes import GROUPS, write

ROOT = Path(__file__).parents[2]
Ends = dict[str, dict[str, Any]]  # "check" and "play": each the exit code and what was said


@pytest.fixture(scope="module")
def ends_of(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[[Path], Ends]]:
    """A function that tells how the check and an environment end on a home, from a process that outlives them."""
    told = tmp_path_factory.mktemp("strangers") / "stderr"
    with (
        told.open("w") as errors,
        subprocess.Popen(
            [sys.executable, ROOT / "tests/helpers/hostile_homes.py"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=errors, text=True,
            env={**os.environ, "PYTHONPATH": str(ROOT)}, cwd=told.parent,
        ) as process,
    ):  # fmt: skip
        asked, answers = process.stdin, process.stdout
        assert asked and answers

        def ends(folder: Path) -> Ends:
            print(folder, file=asked, flush=True)
            line = answers.readline()
            assert line, told.read_text()
            end: Ends = json.loads(line)
            return end

        yield ends


@pytest.mark.parametrize("group", GROUPS)
def test_homes_from_strangers(tmp_path: Path, group: str, ends_of: Callable[[Path], Ends]) -> None:
    wrong = {}
    for number, (name, files) in enumerate(GROUPS[group]().items()):
        write(tmp_path / str(number), files)
        end = ends_of(tmp_path / str(number))
        if not (_plays(end) if group == "playable" else _is_refused(end)):
            wrong[name] = end
    assert not wrong, "\n".join(f"{name}: {end}" for name, end in wrong.items())


def _plays(end: Ends) -> bool:
    return end["check"] == end["play"] == {"code": 0, "says": ""}


def _is_refused(end: Ends) -> bool:
    """Whether the check and the environment refuse a home, the latter with one line."""
    check, play = end["check"], end["play"]
    lines = check["says"].count("\n")
    is_told = check["code"] == 1 or (check["code"], lines) == (2, 1)
    return (play["code"], play["says"].count("\n")) == (2, 1) and is_told
