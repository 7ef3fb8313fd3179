"""The table of the generated splits in docs/benchmark.md holds what the committed lengths of episodes say."""

import json
import re
from pathlib import Path
from statistics import fmean
from typing import Any

import pytest

from chmarl_pb.evaluation.as_text import interval, percent
from chmarl_pb.evaluation.metrics import Played, summarize
from chmarl_pb.evaluation.provenance import tasks_hash
from chmarl_pb.tasks.splits import fixed_homes, load_tasks

ROOT = Path(__file__).parents[2]
SPLITS = ("generated-val", "generated-test")


def lengths_of(split: str) -> dict[str, Any]:
    data: dict[str, Any] = json.loads((ROOT / "results" / f"{split}.json").read_text(encoding="utf-8"))
    return data


ROWS = [(split, policy) for split in SPLITS for policy in next(iter(lengths_of(split)["lengths"].values()))]


@pytest.mark.parametrize(("split", "homes"), [("generated-val", 50), ("generated-test", 100)])
def test_the_lengths_are_of_these_tasks_and_homes(split: str, homes: int) -> None:
    data, tasks = lengths_of(split), load_tasks(split)
    assert data["tasks"] == tasks_hash(tasks) and data["homes"].items() <= fixed_homes().items()
    assert len(data["lengths"]) == len(tasks) and len(data["homes"]) == homes


@pytest.mark.parametrize(("split", "policy"), ROWS)
def test_a_row_of_the_table(split: str, policy: str) -> None:
    text = (ROOT / "docs" / "benchmark.md").read_text(encoding="utf-8")
    table = text.split("## Splits in generated homes")[1].split("## The grounded track")[0]
    found = re.search(rf"^\| {policy} \|(.*)\|$", table, re.MULTILINE)
    assert found, "it has no row"
    data = lengths_of(split)
    episodes = [
        Played(task, seed, steps or data["max_steps"], steps is not None, 0.0)
        for task in load_tasks(split)
        for seed, steps in enumerate(data["lengths"][task.id][policy])
    ]
    summary = summarize(episodes)
    shares = [f"{percent(share)} [{interval(share)}]" for share in (summary.success_rate, summary.plw)]
    steps = fmean(episode.steps for episode in episodes if episode.success)
    first = 3 * SPLITS.index(split)
    assert [cell.strip() for cell in found[1].split("|")][first : first + 3] == [*shares, f"{steps:.1f}"]
