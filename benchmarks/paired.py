"""The speed of this checkout beside another one's: ``python -m benchmarks.paired OTHER_CHECKOUT``.

Each figure of ``chmarl-pb bench`` is measured in turns, a short run here, a short run there, so that what else the
machine does slows both alike; the table shows the median of the ratios. Each checkout has a process of its own.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

from rich.table import Table

from chmarl_pb.bench.figures import Figure, chosen
from chmarl_pb.bench.playing import Effort, Sample
from chmarl_pb.cli.bench import readable, wide_console

HERE = Path(__file__).parents[1]
#: Measures one figure, one sample for each line that it reads; the first line is the figure's name and the effort.
_WORKER = """
import json, sys
from chmarl_pb.bench.figures import FIGURES
from chmarl_pb.bench.playing import Effort
name, effort = json.loads(input())
stream = next(figure for figure in FIGURES if figure.name == name).measure(Effort(**effort))
for _ in sys.stdin:
    print(json.dumps(next(stream)), flush=True)
"""


class Worker:
    """A process that measures a figure with the package of one checkout."""

    def __init__(self, checkout: Path, figure: str, effort: Effort):
        """Start the process."""
        env, pipe = {**os.environ, "PYTHONPATH": str(checkout)}, subprocess.PIPE
        self._process = subprocess.Popen(
            [sys.executable, "-c", _WORKER], cwd=checkout, env=env, stdin=pipe, stdout=pipe, text=True
        )
        self._say(json.dumps([figure, vars(effort)]))

    def _say(self, line: str) -> None:
        assert self._process.stdin is not None
        print(line, file=self._process.stdin, flush=True)

    def sample(self) -> Sample:
        """Measure once.

        Raises:
            RuntimeError: the process has failed.
        """
        assert self._process.stdout is not None
        self._say("")
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"measuring {self._process.args!r} failed, see above")
        sample: Sample = json.loads(line)
        return sample

    def close(self) -> None:
        """End the process."""
        self._process.communicate()


def pairs(figure: Figure, other: Path, effort: Effort) -> Iterator[tuple[Sample, Sample]]:
    """Yield samples of a figure, here and in another checkout, one right after the other."""
    with ExitStack() as stack:
        workers = {checkout: Worker(checkout, figure.name, effort) for checkout in (HERE, other)}
        for worker in workers.values():
            stack.callback(worker.close)
            worker.sample()  # gets to know its home, and what follows is warm
        for number in range(effort.runs):
            order = (HERE, other) if number % 2 else (other, HERE)
            taken = {checkout: workers[checkout].sample() for checkout in order}
            yield taken[HERE], taken[other]


def main() -> None:
    """Measure the figures asked for and print each row when it is done."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("other", type=Path, metavar="OTHER_CHECKOUT", help="its root, e.g. a `git worktree`")
    parser.add_argument("--only", action="append", metavar="NAME", help="figures whose names contain this")
    parser.add_argument("--runs", type=int, default=20, metavar="N", help="pairs (default: %(default)s)")
    parser.add_argument("--seconds", type=float, default=0.5, help="of one run (default: %(default)s)")
    parser.add_argument("--warm-up", type=int, default=20_000, help="steps before (default: %(default)s)")
    options = parser.parse_args()
    if not (options.other / "chmarl_pb" / "__init__.py").is_file():
        parser.error(f"{options.other}: is no checkout of this project; name the root of one")
    if options.runs < 2 or options.seconds <= 0 or options.warm_up < 0:
        parser.error("--runs: use at least 2, --seconds more than 0, --warm-up at least 0")
    effort = Effort(options.runs, options.seconds, options.warm_up)
    table = Table(title=f"{HERE} beside {options.other.resolve()}")
    for column in ("figure", "unit", "here", "there", "here / there", "quartiles"):
        table.add_column(column, justify="left" if column in ("figure", "unit") else "right")
    try:
        for figure in chosen(options.only or ()):
            taken = list(pairs(figure, options.other.resolve(), effort))
            for unit in taken[0][0]:
                ours, theirs = [pair[0][unit] for pair in taken], [pair[1][unit] for pair in taken]
                ratios = [
                    one / other if other else float(one == other) for one, other in zip(ours, theirs, strict=True)
                ]
                low, middle, high = statistics.quantiles(ratios, n=4)
                medians = readable(statistics.median(ours)), readable(statistics.median(theirs))
                table.add_row(figure.name, unit, *medians, f"{middle:.3f}", f"{low:.2f} to {high:.2f}")
    finally:
        wide_console().print(table)


if __name__ == "__main__":
    main()
