"""Task files that are built: an interrupted build goes on, and ends as one that was not."""

from collections.abc import Callable
from pathlib import Path

import pytest

from chmarl_pb.data import build_tasks
from chmarl_pb.data.build_tasks import Kind, Slot, SolvedFile, build_all, build_split
from chmarl_pb.tasks.splits import read_tasks
from chmarl_pb.tasks.task import Task

Solve = Callable[[Slot], tuple[int, Task]]


@pytest.fixture
def solved(monkeypatch: pytest.MonkeyPatch) -> list[Slot]:
    """The slots that were solved, which are those of one small split."""
    slots, solve = list[Slot](), build_tasks._solve_slot

    def noted(slot: Slot) -> tuple[int, Task]:
        slots.append(slot)
        return solve(slot)

    monkeypatch.setattr(build_tasks, "_solve_slot", noted)
    monkeypatch.setattr(build_tasks, "SPLIT_SIZES", {"val-unseen": 5})
    monkeypatch.setattr(build_tasks, "GENERATED_HOMES", {})
    return slots


def interrupted_after(number: int, folder: Path, taken: set[Kind]) -> None:
    """Build a split until so many tasks are chosen."""
    chosen = []

    def progress(done: int) -> None:
        chosen.append(done)
        if len(chosen) == number:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        build_split("val-unseen", 5, taken, 1, progress, SolvedFile(folder / "val-unseen.csv", "val-unseen"))


def test_an_interrupted_build_goes_on(tmp_path: Path, solved: list[Slot]) -> None:
    assert build_all(tmp_path / "whole", 1) == 0
    count = len(solved)
    (tmp_path / "cut").mkdir()
    interrupted_after(3, tmp_path / "cut", set())
    assert build_all(tmp_path / "cut", 1) == 0
    assert len(solved) == 2 * count, "none was solved again"
    assert (tmp_path / "cut" / "val-unseen.csv").read_bytes() == (tmp_path / "whole" / "val-unseen.csv").read_bytes()
    assert len(read_tasks(tmp_path / "cut" / "val-unseen.csv")) == 5
    assert not list((tmp_path / "cut").glob("*.partial"))


def test_what_is_damaged_or_of_another_version_is_solved_again(
    tmp_path: Path, solved: list[Slot], monkeypatch: pytest.MonkeyPatch
) -> None:
    interrupted_after(3, tmp_path, set())
    path = tmp_path / "val-unseen.csv.partial"
    path.write_text(path.read_text()[:-20] + "\nmy notes\n")
    assert len(SolvedFile(tmp_path / "val-unseen.csv", "val-unseen").solved) == 2
    monkeypatch.setattr(build_tasks, "source_hash", lambda: "other")
    assert SolvedFile(tmp_path / "val-unseen.csv", "val-unseen").solved == {}
