"""What the tables of results are made of: runs of a row, their values, and how a cell shows them."""

from collections.abc import Sequence
from functools import cache
from statistics import fmean, stdev

from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.evaluation.cooperation import reference_scores
from chmarl_pb.evaluation.gain import gain_of_runs, is_of_audit
from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.paper import SPLITS
from training.tables.record import Record
from training.tables.row import Row

Records = dict[tuple[str, str], list[Record]]

METRICS = {"PLW": "plw", "Success rate": "success_rate"}
_SUCCESS_FIRST = ("success_rate", "plw")
NOT_RUN = "not run yet"
HEADLINE = SPLITS[-1]
#: Rows in which a built-in policy flies the drone have this in their names; with pictures it is told what is in view.
ALONE = "humanoid only"


def runs_of(row: Row, records: Records) -> list[Record]:
    """Return the kept runs of a row, one for each seed."""
    return records.get((row.table, row.slug), [])


def values(same: Sequence[Record], metric: str, split: str) -> list[float]:
    """Return a metric of each run, 0 to 1."""
    return [record["evaluation"]["splits"][split]["summary"][metric]["mean"] for record in same]


def run_is_told_more(record: Record) -> bool:
    """Return whether a run is told more than its robots observe: the goal, or beside the humanoid what is in view."""
    goal = record["evaluation"]["options"].get("goal")
    return bool(goal) or (record["observation"] == "visual" and ALONE in record["name"])


def gained(same: Sequence[Record]) -> Figure | None:
    """Return the gain of runs over the best blind policy, in points.

    None if they are told more than their robots, or were not played by its rules.
    """
    splits = [record["evaluation"]["splits"][HEADLINE] for record in same]
    for record, split in zip(same, splits, strict=True):
        alike = is_of_audit(record["evaluation"]["options"], split["tasks_sha256"], HEADLINE)
        if run_is_told_more(record) or not alike:
            return None
    of_tasks = [split["plw_of_tasks"] for split in splits if "plw_of_tasks" in split]
    return gain_of_runs(values(same, "plw", HEADLINE), of_tasks, HEADLINE)


def cell(values: Sequence[float]) -> str:
    """Return mean and spread of shares, in per cent."""
    if not values:
        return ""
    spread = f" ± {100 * stdev(values):.1f}" if len(values) > 1 else ""
    return f"{100 * fmean(values):.1f}{spread}"


def both(same: Sequence[Record], split: str) -> str:
    """Return mean success and PLW of runs on a split, in per cent; "" if they were not played there."""
    known = [record for record in same if split in record["evaluation"]["splits"]]
    return " / ".join(f"{100 * fmean(values(known, metric, split)):.1f}" for metric in _SUCCESS_FIRST) if known else ""


@cache
def built_in(policy: str, metric: str, split: str) -> float | None:
    """Return a metric of a built-in policy, 0 to 1, from the lengths that are kept of it."""
    scores = reference_scores(split, MAX_STEPS)
    return getattr(scores[policy], metric) if policy in scores else None


def shown_name(row: Row) -> str:
    """Return a row's name as the tables show it."""
    return row.name if row.published else f"*{row.name}* (ours)"
