"""The script that measures how scores depend on messages and feedback."""

import json
import sys
from pathlib import Path

import pytest

from benchmarks import dials

pytest.importorskip("matplotlib")


def test_points_are_measured_printed_drawn_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def run(*more: str) -> str:
        arguments = ["--policy", "open-loop", "--split", "val-unseen", "--track", "paper", "--dial", "messages"]
        figures = ["--json", str(tmp_path / "dials.json"), "--plot", str(tmp_path / "dials.png")]
        monkeypatch.setattr(
            sys, "argv", ["dials", *arguments, *figures, "--out", str(tmp_path), "--workers", "1", *more]
        )
        dials.main()
        return capsys.readouterr().out

    first = run("--only", "the board", "--only", "silence")
    rows = [line for line in first.splitlines() if line.startswith(("| the board", "| silence"))]
    assert len(rows) == 2 and rows[0].split("|")[2] == rows[1].split("|")[2]  # a tour hears nothing
    points = json.loads((tmp_path / "dials.json").read_text(encoding="utf-8"))["points"]
    assert [point["name"] for point in points] == ["the board", "silence"]
    assert points[0]["plw"]["low"] <= points[0]["plw"]["mean"] <= points[0]["plw"]["high"]
    assert (tmp_path / "dials.png").read_bytes().startswith(b"\x89PNG")
    kept = next(tmp_path.glob("*silence*.json"))
    before = kept.stat().st_mtime_ns
    run("--only", "silence")
    assert kept.stat().st_mtime_ns == before
