"""Sections of the page of results that are made of rows of several tables, or of other results."""

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.cooperation import read_reference
from chmarl_pb.evaluation.paper import SPLITS
from chmarl_pb.files import sealed
from chmarl_pb.policies.weights import read_manifest, weights_folder
from chmarl_pb.tasks.splits import load_tasks
from training.tables.attribution import LINES, attribution
from training.tables.cells import NOT_RUN, Records
from training.tables.goals import GOALS, goals
from training.tables.hundred_homes import SHOWN, hundred_homes
from training.tables.page import write_page
from training.tables.row import LIMITED, LIMITED_SCORED, Row
from training.tables.rows import TABLES
from training.tables.runs import FORMAT
from training.tables.without_feedback import without_feedback


def row_of(table: str, name: str) -> Row:
    return next(row for row in TABLES[table] if row.name == name)


def test_each_part_is_told_beside_the_line_that_it_changes() -> None:
    records: Records = {}
    plws = {1: [0.1, 0.2], 2: [0.4], 3: [0.55], 7: [0.6], 5: [0.5]}
    for number, values in plws.items():
        row = row_of(LINES[number - 1].table, LINES[number - 1].row)
        one = {split: {"summary": {"plw": {"mean": 0}, "success_rate": {"mean": 0.9}}} for split in SPLITS}
        for plw in values:
            splits = json.loads(json.dumps(one))
            splits["test-unseen"]["summary"]["plw"]["mean"] = plw
            record = {"checkpoint": {"config": {}}, "evaluation": {"splits": splits}, "observation": row.observation}
            records.setdefault((row.table, row.slug), []).append(record)
    lines = [line for line in attribution(records).splitlines() if line.startswith("| ") and line[2].isdigit()]
    ends = [line.split("|")[-5:-1] for line in lines]
    assert [[cell.strip() for cell in end] for end in ends] == [
        ["90.0 / 15.0", "", "", ""], ["90.0 / 40.0", "line 1", "+0.0", "+25.0"],
        ["90.0 / 55.0", "line 2", "+0.0", "+15.0"], ["", "line 3", "", ""], ["90.0 / 50.0", "line 4", "", ""],
        ["", "line 5", "", ""], ["90.0 / 60.0", "line 5", "+0.0", "+10.0"], *[["", "line 7", "", ""]] * 2,
        ["", "line 9", "", ""], *[["", f"line {number}", "", ""] for number in (7, 8, 10, 8, 8, 8)],
    ]  # fmt: skip


@pytest.mark.parametrize(("plw", "met"), [(0.38, "yes"), (0.379, "no")])
def test_a_goal_is_met_if_both_of_its_numbers_are(plw: float, met: str, tmp_path: Path) -> None:
    row = row_of("scene-graph", GOALS[0].row)
    split = {"summary": {"plw": {"mean": plw}, "success_rate": {"mean": 0.9}}}
    records: Any = {(row.table, row.slug): [{"evaluation": {"splits": {"test-unseen": split}}}]}
    lines = goals(records, tmp_path).splitlines()
    first, second = (line for line in lines if line.startswith("| ") and "PPO, humanoid only" in line)
    assert first == f"| PPO, humanoid only, goal observed | 75 / 38 | 90.0 / {100 * plw:.1f} | 1 training | {met} |  |"
    assert second == f"| Recurrent PPO, humanoid only, goal observed | 85 / 45 |  | {NOT_RUN} |  |  |"


def test_every_goal_names_a_row_or_published_weights() -> None:
    weights = read_manifest(weights_folder())
    for goal in GOALS:
        named = [row for row in TABLES[goal.table] if (row.name, row.observation) == (goal.row, goal.observation)]
        assert len(named) == (0 if goal.weights else 1) and (not goal.weights or goal.weights in weights)


def test_weights_without_feedback_stand_beside_what_they_have_with_it(tmp_path: Path) -> None:
    published = read_manifest(weights_folder())["ours-graphs"]
    splits = {split: {"summary": {name: {"mean": 0.125} for name in ("success_rate", "plw")}} for split in SPLITS}
    kept: dict[str, Any] = {
        "checkpoint": {"sha256": published.sha256},
        "evaluation": {"options": {"feedback": False}, "splits": splits},
    }
    path = tmp_path / "without-feedback" / "ours-graphs.json"
    path.parent.mkdir()
    assert without_feedback(tmp_path) == []
    path.write_text(sealed(kept))
    _, table = without_feedback(tmp_path)
    figures = published.published["test-unseen"]
    assert table.splitlines()[2].endswith(f"{100 * figures['success_rate']:.1f} / {100 * figures['plw']:.1f} |")
    assert table.splitlines()[3] == "|  | no |" + " 12.5 / 12.5 |" * len(SPLITS)
    for key, value, words in (("feedback", True, "with feedback"), ("sha256", "0", "not the published")):
        changed = json.loads(json.dumps(kept))
        (changed["evaluation"]["options"] if key == "feedback" else changed["checkpoint"])[key] = value
        path.write_text(sealed(changed))
        with pytest.raises(ResultError, match=words):
            without_feedback(tmp_path)


def test_published_weights_in_a_hundred_homes_stand_beside_policies_that_learn_nothing(tmp_path: Path) -> None:
    assert hundred_homes(tmp_path) == []
    tasks = load_tasks("generated-test")
    figure = {"mean": 0.75, "low": 0.7, "high": 0.8}
    found = {
        "summary": {"success_rate": figure, "plw": figure},
        "plw_of_tasks": {task.id: 0.5 + number % 2 / 2 for number, task in enumerate(tasks)},
    }
    kept: dict[str, Any] = {
        "checkpoint": {"sha256": read_manifest(weights_folder())["ours-graphs"].sha256},
        "evaluation": {"options": {"messages": True, "feedback": True}, "splits": {"generated-test": found}},
    }
    path = tmp_path / "generated-test" / "ours-graphs.json"
    path.parent.mkdir()
    path.write_text(sealed(kept))
    assert hundred_homes(tmp_path) == [], "the built-in policies are missing"
    shutil.copy(Path(__file__).parents[2] / "results" / "generated-test.json", tmp_path)
    read_reference.cache_clear()
    _, table = hundred_homes(tmp_path)
    _, _, ours, *others = table.splitlines()
    blind = float(others[0].split(" | ")[2].split()[0])
    assert ours.startswith("| ours-graphs | 75.0 [70.0 to 80.0] | 75.0 [70.0 to 80.0] | ")
    assert float(ours.split(" | ")[3].split()[0]) == pytest.approx(75 - blind, abs=0.11)
    assert [line.split(" | ")[0].strip("| ") for line in others] == [f"*{name}*" for name in SHOWN]
    path.write_text(sealed(kept | {"evaluation": kept["evaluation"] | {"splits": {}}}))
    with pytest.raises(ResultError, match="it is not of generated-test"):
        hundred_homes(tmp_path)


def test_limited_layouts_stand_beside_the_benchmarks(tmp_path: Path) -> None:
    for table, splits in (("scene-graph", SPLITS), (LIMITED, LIMITED_SCORED)):
        row = row_of(table, "BC decentralized + messages, grounded")
        summaries = {
            split: {"summary": {"success_rate": {"mean": 0.5}, "plw": {"mean": 0.1 * number}}, "tasks_sha256": "0"}
            for number, split in enumerate(splits, 1)
        }
        record = {
            "format": FORMAT, "table": table, "row": row.slug, "name": row.name, "seed": 0,
            "observation": "scene_graph", "seconds": {},
            "curve": {"unit": "epochs", "success": [], "loss": [], "validation": []},
            "checkpoint": {"sha256": "0", "config": {}},
            "evaluation": {"source_sha256": "0", "options": {"messages": True, "feedback": True}, "splits": summaries},
        }  # fmt: skip
        path = tmp_path / "results" / table / f"{row.slug}-seed0.json"
        path.parent.mkdir(parents=True)
        path.write_text(json.dumps(record))
    write_page(tmp_path / "results", tmp_path / "results.md")
    text = (tmp_path / "results.md").read_text().split("## Limited layouts")[1]
    name = "| BC decentralized + messages, grounded |"
    assert f"{name} train | 1 of 3 |  | 50.0 / 30.0 | 50.0 / 20.0 | 50.0 / 40.0 | -10.0 |" in text
    assert f"{name} train-limited | 1 of 3 | 50.0 / 10.0 | 50.0 / 20.0 | 50.0 / 30.0 | 50.0 / 40.0 | -30.0 |" in text
