"""The command `chmarl-pb audit`: how much of the score needs neither eyes nor words nor the partner."""

import argparse
import json
from dataclasses import asdict
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from chmarl_pb.cli.arguments import output_file
from chmarl_pb.cli.evaluate import interval, number, percent, progress_bar
from chmarl_pb.envs.options import SENSORS
from chmarl_pb.evaluation.audit import audit
from chmarl_pb.evaluation.audit_file import Audit, Line
from chmarl_pb.policies.registry import PARTS

_WIDTH = 150  # columns of a table that goes into a file


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=run_audit, track="paper")
    parser.add_argument("--split", default="test-unseen", metavar="S", help="split (default: test-unseen)")
    parser.add_argument(
        "--observation", default="scene_graph", metavar="O", help=f"{', '.join(SENSORS)}, or several joined by +"
    )
    parser.add_argument("--seeds", type=int, default=3, metavar="K", help="seeds 0 to K - 1 (default: 3)")
    parser.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    parser.add_argument("--task", action="append", metavar="ID", help="play this task only; may be repeated")
    parser.add_argument("--json", action="store_true", help="print JSON instead of a table")
    parser.add_argument(
        "--out", type=output_file, metavar="JSON",
        help="write the audit here, and the results of its rows beside it (default: out/audit/TRACK-SPLIT.json)",
    )  # fmt: skip


def run_audit(options: argparse.Namespace) -> int:
    """Play the shortcut policies, print their table and write it to a file; return the exit code.

    Rows that are there already and were made with the same settings are kept.

    Raises:
        TaskError: there is no such split or task.
        OptionError: a number is less than 1.
    """
    out = options.out or Path("out/audit") / f"{options.track}-{options.split}.json"
    with progress_bar() as bar:
        found = audit(
            options.split, options.track, range(options.seeds), options.workers, out, partial(_advance, bar, {}),
            observation=options.observation, tasks=options.task,
        )  # fmt: skip
    if options.json:
        print(json.dumps({**found.settings, "rows": list(map(asdict, found.lines))}, indent=1))
        return 0
    console = Console()
    print_audit(console if console.is_terminal else Console(width=_WIDTH), found)
    print(out)
    return 0


def _advance(bar: Progress, tasks: dict[str, TaskID], row: str, finished: int, total: int) -> None:
    if row not in tasks:
        tasks[row] = bar.add_task(row, total=total)
    bar.update(tasks[row], completed=finished, total=total)


def print_audit(console: Console, found: Audit) -> None:
    """Print the table of an audit, and the score that a learner's is to be measured by."""
    settings = found.settings
    title = f"audit of {settings['split']}, {settings['track']} track, {settings['observation']}"
    table = Table(title=title, title_justify="left")
    table.add_column("", no_wrap=True)
    for column in (*PARTS, "success %", "95 % interval", "PLW %", "95 % interval", "steps if solved"):
        table.add_column(column, justify="center" if column in PARTS else "right")
    for line in found.lines:
        table.add_row(line.name, *_cells(line))
    console.print(table)
    best = found.best_blind
    blind = f"best of those that do not see: {best.name}, PLW {percent(best.plw)}"
    console.print(f"{blind}; a score is to be read as its gain over that")


def _cells(line: Line) -> list[str]:
    return [
        *("x" if part in line.uses else "" for part in PARTS),
        percent(line.success_rate), interval(line.success_rate), percent(line.plw), interval(line.plw),
        number(line.steps),
    ]  # fmt: skip
