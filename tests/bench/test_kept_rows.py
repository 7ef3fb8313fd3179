"""Rows that benchmarks keep: they are gone on from, and it is said when other code made them."""

import json
from pathlib import Path

import pytest

from benchmarks import collisions, generated


def test_kept_rows_of_other_code_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "collisions.jsonl"
    options = ["collisions", "--home", "home_1", "--json", str(file), "--episodes"]
    for episodes in ("1", "2"):
        monkeypatch.setattr("sys.argv", [*options, episodes])
        collisions.main()
        assert "other code" not in capsys.readouterr().out
    first, second = map(json.loads, file.read_text().splitlines())
    file.write_text(f"{json.dumps(first | {'source_sha256': 'another'})}\n{json.dumps(second)}\n")
    collisions.main()
    assert f"{file}: 1 of 2 rows were made by other code" in capsys.readouterr().out


def test_kept_homes_of_other_code_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "generated.jsonl"
    monkeypatch.setenv("CHMARL_CACHE", "off")  # as the command sets it, and not for the tests after this one
    monkeypatch.setattr("sys.argv", ["generated", "--homes", "1", "--tasks", "0", "--results", str(file)])
    for _ in range(2):
        generated.main()
        assert "other code" not in capsys.readouterr().out
    kept = json.loads(file.read_text())
    file.write_text(json.dumps({key: kept[key] for key in kept if key != "source_sha256"}) + "\n")  # as before
    generated.main()
    assert f"{file}: 1 of 1 rows were made by other code" in capsys.readouterr().out
