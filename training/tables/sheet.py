"""The scores of every run as a sheet (CSV): a line for each training and split."""

import csv
import io
from pathlib import Path

from chmarl_pb.files import write_atomically
from training.tables.cells import METRICS, Records

COLUMNS = (
    "table", "row", "name", "seed", "observation", "messages", "feedback", "split", "episodes",
    *(f"{metric}{end}" for metric in METRICS.values() for end in ("", "_low", "_high")), "train_minutes",
)  # fmt: skip


def write_sheet(records: Records, path: Path) -> None:
    """Write the scores of all runs.

    Scores are shares, 0 to 1; low and high are the ends of the interval over tasks (95 %), empty where a run has none.

    Args:
        records: the kept runs.
        path: file to write.
    """
    text = io.StringIO()
    lines = csv.DictWriter(text, COLUMNS, lineterminator="\n")
    lines.writeheader()
    for record in (one for same in records.values() for one in same):
        run = {name: record.get(name) for name in COLUMNS} | {"train_minutes": _minutes(record["seconds"])}
        for split, played in record["evaluation"]["splits"].items():
            summary = played["summary"]
            scores = {
                f"{metric}{end}": _rounded(summary[metric].get(key))
                for metric in METRICS.values()
                for end, key in (("", "mean"), ("_low", "low"), ("_high", "high"))
            }
            lines.writerow(run | scores | {"split": split, "episodes": summary.get("episodes")})
    write_atomically(path, text.getvalue())


def _rounded(share: float | None) -> float | None:
    return None if share is None else round(share, 6)


def _minutes(seconds: dict[str, float]) -> float | None:
    return round(seconds["train"] / 60, 1) if "train" in seconds else None
