"""What the belief search owes to homes that it knows: ``python -m benchmarks.known_home``.

Plays splits three times: with the usual statistics, of the five homes of training and of generated ones; with those of
generated homes alone, which is what it can know of the homes that our learners are trained in; and with statistics of
the split's own homes, measured in layouts that no task of the split uses. In the last the same search knows where the
furniture stands and from where it is seen. Prints success and PLW with their 95 % intervals. Nothing is chosen by it.
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
SEEN = ("val-seen", "test-seen")
USUAL, GENERATED, OWN = KNOWN = "the five of training, and generated ones", "generated ones", "its own"
LAYOUTS = 60  # that are measured of a home


def play(split: str, known: str) -> Summary:
    """Return what the belief search scores on a split that knows certain homes, and nothing else.

    In a process of its own: statistics are kept, and what follows from them.
    """
    homes = statistics._read()
    if known == GENERATED:
        trained = len(homes_of("train"))
        homes = [{} for _ in range(trained)] + homes[trained:]
    elif known == OWN:
        homes = [measure(home, LAYOUTS) for home in homes_of(split)]
    with patch.object(statistics, "_read", lambda: homes):
        return evaluate("belief", split, workers=1, seeds=[0]).summary


def main(arguments: Sequence[str] | None = None) -> None:
    """Print both scores of each split."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--split", choices=(*SPLITS, *SEEN), nargs="+", default=SPLITS, help="default: the unseen")
    splits = parser.parse_args(arguments).split
    table = Table("split", "homes that it knows", "success %", "PLW %")
    played = [(split, known) for split in splits for known in KNOWN]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn"), max_tasks_per_child=1) as processes:
        summaries = processes.map(play, *zip(*played, strict=True))
        for (split, known), summary in track(zip(played, summaries, strict=True), "splits", total=len(played)):
            figures = [f"{percent(one)} [{interval(one)}]" for one in (summary.success_rate, summary.plw)]
            table.add_row(split, known, *figures)
    Console().print(table)


if __name__ == "__main__":
    main()
