"""The script that measures how scores depend on messages, feedback and track."""

import json
import sys
from pathlib import Path

import pytest

from benchmarks import dials

pytest.importorskip("matplotlib")


def run(monkeypatch: pytest.MonkeyPatch, folder: Path, *more: str) -> None:
    """Run the command with all that it writes in a folder."""
    arguments = ["--out", str(folder / "results"), "--points", str(folder / "points"), "--workers", "1", *more]
    monkeypatch.setattr(sys, "argv", ["dials", *arguments])
    dials.main()


def test_points_are_measured_printed_drawn_and_kept(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    policy = ["--policy", "tour=open-loop", "--track", "paper", "--thin", "10"]
    run(monkeypatch, tmp_path, *policy, "--messages", "none", "--messages", "board")
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith(("| board", "| none"))]
    assert len(rows) == 2 and rows[0].split("|")[2] == rows[1].split("|")[2]  # a tour hears nothing
    points = json.loads((tmp_path / "points" / "paper-tour.json").read_text(encoding="utf-8"))
    assert [(point["messages"], point["feedback"]) for point in points] == [("board", "none"), ("none", "none")]
    assert points[0]["episodes"] == 5
    assert points[0]["plw"]["low"] <= points[0]["plw"]["mean"] <= points[0]["plw"]["high"]
    kept = next((tmp_path / "results").glob("*-board-none.json"))
    before = kept.stat().st_mtime_ns
    run(monkeypatch, tmp_path, *policy, "--messages", "board")
    assert kept.stat().st_mtime_ns == before and len(dials.load_points(tmp_path / "points")) == 2
    capsys.readouterr()
    run(monkeypatch, tmp_path, "--plot", str(tmp_path / "dials.png"))  # anew, from what is kept
    assert "| board |" in capsys.readouterr().out
    assert (tmp_path / "dials.png").read_bytes().startswith(b"\x89PNG")


def test_all_pairs_are_played_by_who_reads_feedback() -> None:
    both = ["board", "none"], ["none", "paper"]
    assert len(dials.pairs_of("runs/best.pt", *both)) == len(dials.pairs_of("blind", *both)) == 4
    assert dials.pairs_of("belief", *both) == [("board", "none"), ("none", "none")]


def test_what_a_policy_cannot_play_is_left_out(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    run(monkeypatch, tmp_path, "--policy", str(tmp_path / "none.pt"), "--track", "paper", "--messages", "board")
    assert "left out, as" in capsys.readouterr().err and not dials.load_points(tmp_path / "points")


def test_the_points_of_the_docs_can_be_read() -> None:
    points = dials.load_points(dials.POINTS)
    assert {"search", "belief"} <= {point.policy for point in points}
    assert all(len([other for other in points if other == point]) == 1 for point in points)
    assert "| paper: messages |" in dials.table(points)


def test_points_of_some_tasks_do_not_replace_those_of_all(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        run(monkeypatch, tmp_path, "--policy", "open-loop", "--thin", "2", "--points", str(dials.POINTS))
    assert "would replace those of all tasks" in capsys.readouterr().err
