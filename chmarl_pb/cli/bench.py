"""``chmarl-pb bench``: measure with progress shown, print a table, and write JSON."""

import argparse
import os
import platform
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from rich.console import Console
from rich.table import Table

from chmarl_pb import __version__
from chmarl_pb.bench.figures import Row, chosen, measure
from chmarl_pb.bench.playing import Effort
from chmarl_pb.cli.output import Screen, add_json, has, tell
from chmarl_pb.errors import OptionError
from chmarl_pb.progress import LateProgress


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=run)
    add_json(parser, has("version", "machine", "figures"))
    parser.add_argument(
        "--only", action="append", metavar="NAME", help="only figures whose name contains this; may be repeated"
    )
    parser.add_argument(
        "--runs", type=int, default=Effort.runs, metavar="N", help="runs of each figure (default: %(default)s)"
    )
    parser.add_argument(
        "--warm-up", type=int, default=Effort.warm_up, metavar="N",
        help="joint steps whose views are drawn before what is measured warm (default: %(default)s)",
    )  # fmt: skip


def run(options: argparse.Namespace) -> int:
    """Measure, print a table, and write the figures as JSON if that is asked for.

    An interruption keeps what has been measured by then: it is printed, written, and raised again.

    Raises:
        OptionError: no figure has such a name, or a number is less than 1.
    """
    runs, warm_up = options.runs, options.warm_up
    if runs < 1 or warm_up < 1:
        raise OptionError(f"runs={runs}, warm_up={warm_up}: both must be at least 1")
    effort = Effort(runs=runs, warm_up=warm_up)
    figures = chosen(options.only or ())
    rows: list[Row] = []
    try:
        with LateProgress(transient=True) as progress:
            task = progress.add_task("", total=len(figures) * runs)
            for figure in figures:
                progress.update(task, description=figure.name)
                rows += measure(figure, effort, lambda: progress.advance(task))
    finally:
        if rows:
            tell(options, lambda: _facts(rows), lambda: wide_console(Screen).print(_table(rows)))
    return 0


def _machine() -> str:
    return f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"


def _table(rows: Sequence[Row]) -> Table:
    table = Table(title=f"chmarl_pb {__version__} on {_machine()}")
    for column in ("figure", "median", "least", "greatest", "unit"):
        table.add_column(column, justify="left" if column in ("figure", "unit") else "right")
    for before, row in zip([None, *rows], rows, strict=False):
        name = "" if before and before.name == row.name else row.name
        table.add_row(name, *map(readable, (row.median, row.least, row.greatest)), row.unit)
    return table


def wide_console(kind: type[Console] = Console) -> Console:
    """Return a console that gives tables room where the output is no terminal."""
    return kind() if sys.stdout.isatty() else kind(width=120)


def readable(value: float) -> str:
    """Return a number with three digits that count, or all digits before the point."""
    return f"{value:,.0f}" if abs(value) >= 100 or value % 1 == 0 else f"{value:.3g}"


def _facts(rows: Sequence[Row]) -> dict[str, Any]:
    return {"version": __version__, "machine": _machine(), "figures": [asdict(row) for row in rows]}
