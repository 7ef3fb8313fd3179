"""The shortcut audit: its rows, its file, and what counts as blind."""

import json
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest

import chmarl_pb
from chmarl_pb.cli import main
from chmarl_pb.cli.audit import table_of
from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError, ResultError
from chmarl_pb.evaluation import audit as module
from chmarl_pb.evaluation.as_text import interval_text, points
from chmarl_pb.evaluation.audit import audit, rows_of, uses
from chmarl_pb.evaluation.audit_file import Audit, load_audit, published_audit
from chmarl_pb.evaluation.gain import _comparable, best_blind, gain, gain_of, gain_of_runs
from chmarl_pb.evaluation.metrics import Figure, Played
from chmarl_pb.evaluation.play import Job, Setup, play
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.result import Report
from chmarl_pb.executors import Local
from chmarl_pb.policies.registry import BUILT_IN, PARTS

TASKS = ["val-unseen-000", "val-unseen-001"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("audits")


@pytest.fixture(scope="module")
def found(folder: Path) -> Audit:
    return audit("val-unseen", seeds=[0], workers=1, out=folder / "audit.json", tasks=TASKS, max_steps=12)


def test_each_policy_says_what_it_uses() -> None:
    assert all(set(policy.uses) <= set(PARTS) for policy in BUILT_IN.values())
    assert {name for name, policy in BUILT_IN.items() if not policy.uses} == {"random", "planner"}


def test_a_setting_has_the_rows_that_can_differ_in_it() -> None:
    names = [row.name for row in rows_of(Options())]
    assert len(set(names)) == len(names) and len({row.slug for row in rows_of(Options())}) == len(names)
    assert {"blind, no feedback", "blind, no feedback and no messages", "feedback-only, planner's words"} <= set(names)
    assert "blind, no messages" not in names  # that is feedback-only
    grounded = [row.name for row in rows_of(Options(track="grounded"))]
    assert set(grounded) == {
        "random", "blind", "open-loop", "instruction-blind", "partner-blind", "colour-blind", "reactive", "search",
        "belief", "planner",
    }  # fmt: skip
    assert "colour-blind" not in {row.name for row in rows_of(Options(track="grounded", lookalikes=False))}


def test_who_has_no_code_uses_no_own_words() -> None:
    talking = Options(messages="symbols")
    assert "messages" not in uses("blind", talking) and "messages" in uses("search", talking)
    assert "feedback" not in uses("blind", Options(feedback=False))


def test_an_audit_says_what_counts_as_blind(found: Audit) -> None:
    lines = {line.name: line for line in found.lines}
    assert lines["planner"].success_rate.mean == 1 and not lines["planner"].blind
    assert not lines["feedback-only, planner's words"].blind  # no robot of the setting is given these
    assert all(line.blind != line.eyes for line in found.lines if line.name.startswith(("blind", "instruction")))
    assert lines["blind, no feedback"].uses == ("messages", "partner")
    assert lines["instruction-blind, no feedback and no messages"].uses == ("eyes",)
    best = replace(lines["open-loop"], plw=Figure(1.0))
    assert replace(found, lines=(*found.lines, best)).best_blind is best


def test_an_audit_is_read_as_it_was_written(found: Audit, folder: Path) -> None:
    assert load_audit(folder / "audit.json") == found
    text = json.loads((folder / "audit.json").read_text())
    assert text["best_blind"] == found.best_blind.name
    assert text["blind_plw"].keys() == set(TASKS)
    assert fmean(text["blind_plw"].values()) == pytest.approx(found.best_blind.plw.mean, abs=1e-6)
    (folder / "broken.json").write_text(json.dumps({**text, "rows": [{}]}))
    with pytest.raises(ResultError, match="audit again"):
        load_audit(folder / "broken.json")
    with pytest.raises(ResultError, match="chmarl-pb audit"):
        load_audit(folder / "none.json")


def test_rows_that_are_there_are_not_played_again(found: Audit, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert len(list((folder / "audit").glob("*.json"))) == len(found.lines)
    (folder / "audit" / "open-loop.json").unlink()
    played: list[Any] = []

    def noted(policy: str, *given: Any, **options: Any) -> Report:
        return evaluate(policy, *given, **options | {"plays": lambda setup, jobs: _plays(played, setup, jobs)})

    monkeypatch.setattr(module, "evaluate", noted)
    again = audit("val-unseen", seeds=[0], workers=1, out=folder / "audit.json", tasks=TASKS, max_steps=12)
    assert again == found and played == ["open-loop"]


def _plays(played: list[Any], setup: Setup, jobs: Sequence[Job]) -> Iterator[Played]:
    played.append(setup.policy)
    return play(setup, jobs, Local(1))


def test_files_of_others_are_found_before_a_row_is_played(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("chmarl_pb.evaluation.audit.evaluate", lambda *row, **options: pytest.fail("a row is played"))
    (tmp_path / "audit").mkdir()
    (tmp_path / "audit" / "planner.json").write_text("my notes")
    with pytest.raises(OptionError, match=r"planner\.json is there already and is not a result"):
        audit("val-unseen", out=tmp_path / "audit.json")


def test_the_command_prints_a_table_or_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    given = ["audit", "--split", "val-unseen", "--seeds", "1", "--workers", "1", "--task", TASKS[0]]
    given += ["--out", str(folder / "command.json")]
    assert main(given) == 0
    table = capsys.readouterr().out
    assert (
        "| instruction-blind | eyes, messages, feedback, partner |" in table
        and "best of those that do not see" in table
    )
    assert main([*given, "--json"]) == 0
    assert len(json.loads(capsys.readouterr().out)["rows"]) == len(rows_of(Options()))


def test_the_package_has_the_function() -> None:
    assert chmarl_pb.audit is audit


@pytest.mark.parametrize("split", ["test-unseen", "val-unseen"])
def test_the_docs_have_the_tables_that_come_with_the_package(split: str) -> None:
    published = published_audit(split)
    assert published is not None
    text = (Path(__file__).parents[2] / "docs" / "benchmark.md").read_text(encoding="utf-8")
    assert "\n".join(table_of(published)) in text


def test_a_gain_is_that_over_the_best_blind_policy() -> None:
    best = best_blind("test-unseen")
    assert best is not None and not best.eyes and best.plw.mean is not None
    gained = gain([best.plw.mean + 0.02, best.plw.mean + 0.04], "test-unseen")
    assert gained == pytest.approx(3) and points(gained) == "+3.0"
    assert gain([], "test-unseen") is None and gain([0.5], "generated-val") is None and points(None) == ""


def test_the_interval_of_a_gain_is_of_pairs() -> None:
    published = published_audit("val-unseen")
    assert published is not None and len(published.blind_plw) == 50
    for ahead in (0.0, 0.05):  # over the same in every task: whichever tasks are drawn, the gain is this
        plws = {task: plw + ahead for task, plw in published.blind_plw.items()}
        gained = gain_of_runs([fmean(plws.values())] * 2, [plws] * 2, "val-unseen")
        assert gained is not None and (gained.mean, gained.low, gained.high) == pytest.approx(
            [100 * ahead] * 3, abs=1e-3
        )
        unknown = gain_of_runs([fmean(plws.values())] * 2, [plws], "val-unseen")
        assert unknown is not None and unknown.low is None, "one training does not tell"
    report = evaluate("search", "val-unseen", seeds=[0], workers=1)
    gained = gain_of(report)
    assert gained is not None and gained.mean == pytest.approx(gain([report.plw], "val-unseen"))
    assert gained.mean is not None and gained.low is not None and gained.high is not None
    assert gained.low < gained.mean < gained.high
    assert interval_text(gained) == f"{gained.low:+.1f} to {gained.high:+.1f}"


def test_who_is_told_the_truth_has_no_gain() -> None:
    assert gain_of(evaluate("planner", "val-unseen", seeds=[0], workers=1)) is None


def test_feedback_alone_is_one_row() -> None:
    names = [row.name for row in rows_of(Options())]
    assert "feedback-only" in names and not {"blind, no messages", "instruction-blind, no messages"} & set(names)
    assert "instruction-blind, no messages" in [row.name for row in rows_of(Options(feedback=False))]


def test_results_of_other_tasks_or_rules_have_no_gain() -> None:
    published = published_audit("val-unseen")
    assert published is not None
    whole = Report({**published.settings, "policy": "x", "seeds": [0]}, {}, ())
    assert _comparable(whole, published)
    for change in ({"max_steps": 56}, {"pointing": True}):
        other = {**whole.settings, "options": {**whole.settings["options"], **change}}
        assert not _comparable(replace(whole, settings=other), published)
    few = replace(whole, settings={**whole.settings, "tasks_sha256": "0"})
    assert not _comparable(few, published)
    quiet = {**whole.settings, "options": {**whole.settings["options"], "feedback": False}}
    assert _comparable(replace(whole, settings=quiet), published)
