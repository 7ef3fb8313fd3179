"""Files that others made never end, stop or fill the process: each home is refused with one message, or it plays."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.hostile_homes import GROUPS, write

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize("group", GROUPS)
def test_homes_from_strangers(tmp_path: Path, group: str) -> None:
    homes = GROUPS[group]()
    folders = [tmp_path / str(number) for number in range(len(homes))]
    for folder, files in zip(folders, homes.values(), strict=True):
        write(folder, files)
    run = subprocess.run(
        [sys.executable, ROOT / "tests/helpers/hostile_homes.py", *folders],
        capture_output=True, text=True, timeout=600, env={**os.environ, "PYTHONPATH": str(ROOT)}, cwd=tmp_path,
    )  # fmt: skip
    ends = [json.loads(line) for line in run.stdout.splitlines()]
    assert len(ends) == len(homes), run.stderr
    wrong = {
        name: end
        for name, end in zip(homes, ends, strict=True)
        if not (_plays(end) if group == "playable" else _is_refused(end))
    }
    assert not wrong, "\n".join(f"{name}: {end}" for name, end in wrong.items())


def _plays(end: dict) -> bool:
    return end["check"] == end["play"] == {"code": 0, "says": ""}


def _is_refused(end: dict) -> bool:
    """Whether the check and the environment refuse a home, the latter with one line."""
    check, play = end["check"], end["play"]
    lines = check["says"].count("\n")
    return (play["code"], play["says"].count("\n")) == (2, 1) and (
        check["code"] == 1 or (check["code"], lines) == (2, 1)
    )
