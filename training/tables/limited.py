"""Clones in limited layouts: how far they fall from homes that they know by heart to homes never seen."""

from collections.abc import Sequence
from statistics import fmean

from chmarl_pb.evaluation.paper import SPLITS
from training.tables.cells import METRICS, Records, both, runs_of, values
from training.tables.made_with import seeds
from training.tables.row import LIMITED_SCORED, Row
from training.tables.rows import TABLES

TITLE = "Limited layouts"

NOTE = """Not of the benchmark: a data set in which each class of object has one place in a home
([data.md](data.md#limited-layouts)), so that it pays to know the home by heart, beside the benchmark's own, where
places are drawn for every task. The clones differ in their data alone. *test-limited*: the five homes of training with
every object where it always lies; *test-seen*: the same homes, objects elsewhere
(13 of its 250 tasks have the home, object and classes of one of train-limited); the other two are homes never seen.
The weights are the best on val-limited alone, as homes are to be known by heart (the benchmark's data: the best on
val-seen and val-unseen); up to epoch 6 those of seed 0 were chosen on val-limited and val-unseen
([how that differs](training_encoders.md#limited-layouts)). Cells are success / PLW, per cent, means over seeds;
*falls*: points of PLW from tasks like
those of training to test-unseen.
"""

#: Split of the data -> splits with tasks like those of training.
_ALIKE = {"train": SPLITS[2], "train-limited": LIMITED_SCORED[0]}


def table(rows: Sequence[Row], records: Records) -> str:
    """Return the table as Markdown: each row below that of the same name which learned from the benchmark's data."""
    lines = [f"| | learned from | seeds | {' | '.join(LIMITED_SCORED)} | falls |"]
    lines.append("|---|---|---|" + "--:|" * (len(LIMITED_SCORED) + 1))
    for row in rows:
        same_name = [other for other in TABLES["scene-graph"] if other.name == row.name]
        lines += [_line(one, records) for one in (*same_name, row)]
    return "\n".join(lines)


def _line(row: Row, records: Records) -> str:
    same = runs_of(row, records)
    alike, unseen = (values(same, METRICS["PLW"], split) for split in (_ALIKE[row.data], SPLITS[-1]))
    falls = f"{100 * (fmean(alike) - fmean(unseen)):.1f}" if same else ""
    cells = " | ".join(both(same, split) for split in LIMITED_SCORED)
    return f"| {row.name} | {row.data} | {seeds(row, same)} | {cells} | {falls} |"
