"""``chmarl-pb bench``: measure with progress shown, print a table, and write JSON."""

import json
import os
import platform
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from chmarl_pb import __version__
from chmarl_pb.bench.figures import Row, chosen, measure
from chmarl_pb.bench.playing import Effort
from chmarl_pb.errors import OptionError


def run(out: Path | None, only: Sequence[str] = (), runs: int = Effort.runs) -> int:
    """Measure, print a table, and write the figures as JSON if a file is given.

    An interruption keeps what has been measured by then: it is printed, written, and raised again.

    Args:
        out: JSON file to write.
        only: measure just the figures whose names contain one of these texts.
        runs: how often each is measured.

    Raises:
        OptionError: no figure has such a name, or there are no runs.
    """
    if runs < 1:
        raise OptionError(f"runs={runs} is less than 1")
    figures = chosen(only)
    rows: list[Row] = []
    try:
        with Progress(transient=True) as progress:
            task = progress.add_task("", total=len(figures) * runs)
            for figure in figures:
                progress.update(task, description=figure.name)
                rows += measure(figure, Effort(runs=runs), lambda: progress.advance(task))
    finally:
        if rows:
            Console().print(_table(rows))
            if out is not None:
                _write(rows, out)
    return 0


def _machine() -> str:
    return f"{platform.processor() or platform.machine()}, {os.cpu_count()} cores, Python {platform.python_version()}"


def _table(rows: Sequence[Row]) -> Table:
    table = Table(title=f"chmarl_pb {__version__} on {_machine()}")
    for column in ("figure", "median", "least", "greatest", "unit"):
        table.add_column(column, justify="left" if column in ("figure", "unit") else "right")
    for row in rows:
        table.add_row(row.name, *map(readable, (row.median, row.least, row.greatest)), row.unit)
    return table


def readable(value: float) -> str:
    """Return a number with three digits that count, or all digits before the point."""
    return f"{value:,.0f}" if abs(value) >= 100 or value % 1 == 0 else f"{value:.3g}"


def _write(rows: Sequence[Row], out: Path) -> None:
    temporary = out.with_suffix(f".{os.getpid()}.tmp")
    content = {"version": __version__, "machine": _machine(), "figures": [asdict(row) for row in rows]}
    temporary.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    temporary.replace(out)
