"""Scores for seen and for held-out wording apart: in results, old and new, on the screen and in the report."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from chmarl_pb.cli import main
from chmarl_pb.evaluation.metrics import Played, summarize
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.result import Report, load_result
from chmarl_pb.tasks import language
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task

SEEN, HELD_OUT = (
    next(task for task in load_tasks("test-unseen") if language.wording_of_task(task) == wording)
    for wording in language.WORDINGS
)


@pytest.fixture(scope="module")
def report() -> Report:
    return evaluate("random", tasks=[HELD_OUT, SEEN], seeds=(0, 1), workers=1, max_steps=3)


def played(task: Task, success: bool, instruction: str = "") -> Played:
    return Played(task, 0, task.optimal_steps, success, 10.0 * success, instruction=instruction)


def test_a_result_knows_both_scores(report: Report) -> None:
    assert list(report.per_wording) == ["seen", "held-out"]
    assert [summary.episodes for summary in report.per_wording.values()] == [2, 2]
    mixed = replace(report, episodes=(played(SEEN, True), played(HELD_OUT, False)))
    assert [summary.success_rate.mean for summary in mixed.per_wording.values()] == [1.0, 0.0]


def test_what_was_asked_for_counts_not_what_the_task_would_ask_for(report: Report) -> None:
    assert report.episodes[0].instruction == language.instruction(HELD_OUT)
    assert played(HELD_OUT, True, "Put the mug on the desk.").wording == "seen"
    assert played(SEEN, True, "Deposit the mug on the desk.").wording == "held-out"


def test_other_tasks_have_seen_words_whatever_they_are_of() -> None:
    own = Task("mine", "home_1", "my_gadget", "bed", "desk", 0, 5)
    assert played(own, True).wording == "seen"


def test_older_results_tell_it_from_their_tasks(tmp_path: Path, report: Report) -> None:
    older = replace(report, episodes=tuple(replace(episode, instruction="") for episode in report.episodes))
    older.save(tmp_path / "older.json")
    assert '"instruction"' not in (tmp_path / "older.json").read_text()
    assert load_result(tmp_path / "older.json").per_wording == report.per_wording


def test_a_result_file_holds_both(tmp_path: Path, report: Report) -> None:
    report.save(tmp_path / "result.json")
    data = json.loads((tmp_path / "result.json").read_text())
    assert data["per_wording"]["seen"]["plw"] == report.per_wording["seen"].plw.mean
    assert load_result(tmp_path / "result.json") == report


def test_the_command_prints_both(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    arguments = ["evaluate", "--policy", "planner", "--workers", "1", "--task", SEEN.id]
    assert main(arguments) == 0
    assert "seen words" not in capsys.readouterr().out  # all tasks have the same
    assert main([*arguments, "--task", HELD_OUT.id]) == 0
    printed = capsys.readouterr().out
    assert re.search(r"seen words\W+1\W+100\.0", printed) and re.search(r"held-out words\W+1\W+100\.0", printed)


def test_the_report_shows_both(report: Report) -> None:
    pytest.importorskip("matplotlib")
    from chmarl_pb.evaluation import paper, tables

    episodes = (played(SEEN, True), played(HELD_OUT, False))
    mixed = replace(report, episodes=episodes)
    assert summarize(episodes).plw.mean == 0.5
    assert "seen: 100.0 / 100.0<br>held-out: 0.0 / 0.0" in tables.result_table([mixed])
    row = tables.paper_table(paper.SCENE_GRAPH, [mixed], others=True)
    assert "50.00<br><small>seen 100.0, held-out 0.0</small>" in row
    built_in = row.split("blind<br>")[1].split("</tr>")[0]
    assert built_in.count("seen ") == built_in.count("held-out ") == 8
