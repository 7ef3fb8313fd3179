"""Our speed beside that of other simulators, on the same machine in the same run: ``python -m benchmarks.peers``.

One process, random actions, resets included. Each simulator runs in a process of its own, so that one that is missing
or crashes is skipped with a word. A frame is one square picture that the policy gets; ours has two in a joint step,
the others one in a step. What the others need is in benchmarks/requirements.txt.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import islice
from pathlib import Path

from rich.progress import Progress
from rich.table import Table

from benchmarks.simulators import OURS, PEERS, Peer, Work
from chmarl_pb.bench.playing import Effort
from chmarl_pb.cli.bench import readable, wide_console
from chmarl_pb.files import write_atomically

SIZES = (64, 84, 128, 224)


@dataclass(frozen=True)
class Result:
    """What was measured of a simulator at one size; ``values`` is empty if it was skipped, and ``skipped`` says why."""

    name: str
    size: int | None
    values: tuple[float, ...]
    skipped: str = ""

    @property
    def median(self) -> float:
        """The median of its runs."""
        return statistics.median(self.values)


def result_of(peer: Peer, size: int | None, options: argparse.Namespace) -> Result:
    """Measure a simulator in a process of its own; whatever goes wrong there skips it with a word."""
    command = [sys.executable, "-m", __spec__.name, "--measure", peer.name, "--runs", str(options.runs)]
    command += ["--seconds", str(options.seconds), "--warm-up", str(options.warm_up)]
    command += [] if size is None else ["--sizes", str(size)]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=options.timeout)
    except subprocess.TimeoutExpired:
        return Result(peer.name, size, (), f"took longer than {options.timeout:g} s")
    if done.returncode:
        return Result(peer.name, size, (), reason(peer, done.returncode, done.stderr))
    return Result(peer.name, size, tuple(json.loads(done.stdout.splitlines()[-1])))


def reason(peer: Peer, code: int, errors: str) -> str:
    """Return in a few words why a simulator's process failed."""
    last = errors.strip().splitlines()[-1] if errors.strip() else f"exit code {code}"
    if "ModuleNotFoundError" in last or "ImportError" in last:
        return f"not installed: pip install {peer.install}" if peer.install else last
    return last[:160]


def table(results: Sequence[Result]) -> Table:
    """Return a table of all results, each beside ours at the same size."""
    ours_at = {result.size: result.median for result in results if result.name == OURS and result.values}
    shown = Table(title="one process, random actions, resets included")
    for column in ("simulator", "pictures", "median", "least", "greatest", "unit", "ours / theirs"):
        shown.add_column(column, justify="left" if column in ("simulator", "unit") else "right")
    for result in results:
        pictures = "none" if result.size is None else f"{result.size} px"
        if not result.values:
            shown.add_row(result.name, pictures, "-", "-", "-", result.skipped, "-")
            continue
        numbers = [readable(value) for value in (result.median, min(result.values), max(result.values))]
        unit = "steps/s" if result.size is None else "frames/s"
        ratio = readable(ours_at[result.size] / result.median) if result.size in ours_at else "-"
        shown.add_row(result.name, pictures, *numbers, unit, ratio)
    return shown


def jobs(only: Sequence[str], sizes: Sequence[int]) -> list[tuple[Peer, int | None]]:
    """Return what is to be measured: first all without pictures, then size by size."""
    wanted = [peer for peer in PEERS if not only or any(text.lower() in peer.name.lower() for text in only)]
    symbolic: list[tuple[Peer, int | None]] = [(peer, None) for peer in wanted if peer.symbolic]
    return symbolic + [(peer, size) for size in sizes for peer in wanted if peer.visual]


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all simulators, print a table, and write JSON if asked to."""
    options = _options(arguments)
    if options.measure:
        return _measure(options)
    results: list[Result] = []
    todo = jobs(options.only or (), options.sizes or SIZES)
    try:
        with Progress(transient=True) as progress:
            for peer, size in progress.track(todo):
                progress.console.print(f"{peer.name}, {'no pictures' if size is None else f'{size} px'}", style="dim")
                results.append(result_of(peer, size, options))
    finally:
        wide_console().print(table(results))
        if options.json:
            text = json.dumps([asdict(result) for result in results], indent=1)
            write_atomically(options.json, text + "\n")
    return 0


def _measure(options: argparse.Namespace) -> int:
    """Measure one simulator in this process and print its rates as JSON."""
    peer = next(peer for peer in PEERS if peer.name == options.measure)
    size = options.sizes[0] if options.sizes else None
    effort = Effort(options.runs, options.seconds, options.warm_up)
    print(json.dumps(list(islice(peer.measure(Work(size, effort)), effort.runs))), flush=True)
    os._exit(0)  # without the clean-up of OpenGL libraries, some of which crash in it


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", action="append", metavar="NAME", help="simulators whose name contains this")
    parser.add_argument("--sizes", type=int, nargs="+", metavar="PX", help="picture sizes (default: 64 84 128 224)")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="runs of each (default: 5)")
    parser.add_argument("--seconds", type=float, default=1.0, metavar="S", help="length of a run (default: 1)")
    parser.add_argument("--warm-up", type=int, default=100_000, metavar="N", help="our warm-up, in joint steps")
    parser.add_argument("--timeout", type=float, default=900.0, metavar="S", help="longest wait for one (default: 900)")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the results here as well")
    parser.add_argument("--measure", metavar="NAME", help=argparse.SUPPRESS)
    return parser.parse_args(arguments)


if __name__ == "__main__":
    sys.exit(main())
