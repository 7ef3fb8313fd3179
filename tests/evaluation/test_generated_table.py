"""The table of generated-val in docs/benchmark.md holds what the committed lengths of episodes say."""

import json
import re
from pathlib import Path
from statistics import fmean

import pytest

from chmarl_pb.cli.evaluate import interval, percent
from chmarl_pb.evaluation.metrics import Played, summarize
from chmarl_pb.evaluation.provenance import tasks_hash
from chmarl_pb.tasks.splits import fixed_homes, load_tasks

ROOT = Path(__file__).parents[2]
DATA = json.loads((ROOT / "results" / "generated-val.json").read_text(encoding="utf-8"))
TASKS = load_tasks("generated-val")
POLICIES = list(DATA["lengths"][TASKS[0].id])


def test_the_lengths_are_of_these_tasks_and_homes() -> None:
    assert DATA["tasks"] == tasks_hash(TASKS) and DATA["homes"].items() <= fixed_homes().items()
    assert len(DATA["lengths"]) == len(TASKS) and len(DATA["homes"]) == 50


@pytest.mark.parametrize("policy", POLICIES)
def test_a_row_of_the_table(policy: str) -> None:
    text = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    table = text.split("## Splits in generated homes")[1].split("## Report")[0]
    found = re.search(rf"^\| {policy} \|(.*)\|$", table, re.MULTILINE)
    assert found, "it has no row"
    episodes = [
        Played(task, seed, steps or DATA["max_steps"], steps is not None, 0.0)
        for task in TASKS
        for seed, steps in enumerate(DATA["lengths"][task.id][policy])
    ]
    summary = summarize(episodes)
    steps = fmean(episode.steps for episode in episodes if episode.success)
    cells = [percent(summary.success_rate), interval(summary.success_rate), percent(summary.plw), interval(summary.plw)]
    assert [cell.strip() for cell in found[1].split("|")] == [*cells, f"{steps:.1f}"]
