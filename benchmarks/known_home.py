"""What it costs the belief search that a home is unknown: ``python -m benchmarks.known_home``.

Plays the unseen splits twice: with the usual statistics of the homes of training, and with statistics of the split's
own home, measured in layouts that no task of the split uses. So the same search knows where the furniture stands and
from where it is seen. Prints success and PLW with their 95 % intervals. Nothing is chosen by it.
"""

import argparse
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from unittest.mock import patch

from rich.console import Console
from rich.progress import track
from rich.table import Table

from chmarl_pb.evaluation.as_text import interval, percent
from chmarl_pb.evaluation.metrics import Summary
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.policies.belief import statistics
from chmarl_pb.tasks.splits import homes_of
from tools.build_belief import measure

SPLITS = ("val-unseen", "test-unseen")
LAYOUTS = 60  # that are measured of a home


def play(split: str, known: bool) -> Summary:
    """Return what the belief search scores on a split; where its home is known, nothing else is.

    In a process of its own: statistics are kept, and what follows from them.
    """
    homes = [measure(home, LAYOUTS) for home in homes_of(split)] if known else statistics._read()
    with patch.object(statistics, "_read", lambda: homes):
        return evaluate("belief", split, workers=1, seeds=[0]).summary


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both scores of each split."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=SPLITS, nargs="+", default=SPLITS, help="default: both")
    splits = parser.parse_args(arguments).split
    table = Table("split", "the home is", "success %", "PLW %")
    played = [(split, known) for split in splits for known in (False, True)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), max_tasks_per_child=1) as processes:
        summaries = processes.map(play, *zip(*played, strict=True))
        for (split, known), summary in track(zip(played, summaries, strict=True), "splits", total=len(played)):
            figures = [f"{percent(one)} [{interval(one)}]" for one in (summary.success_rate, summary.plw)]
            table.add_row(split, "known" if known else "unknown", *figures)
    Console().print(table)


if __name__ == "__main__":
    main()
