"""How sure eyes should be: ``python -m benchmarks.eyes``.

Plays policies that see by the detector on validation tasks, with several confidences from which on a class counts as
seen, and prints success and PLW; ``SURE`` of ``chmarl_pb.learning.policies.eyes`` is to be the best of them. Test
splits are refused.
"""

import argparse
from functools import partial
from typing import Any

from chmarl_pb.evaluation.as_text import percent
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.policies.eyes import DetectorEyes
from chmarl_pb.policies.eyes import Seeing
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.progress import progress_bar
from chmarl_pb.tasks.splits import VALIDATION

SPLITS = VALIDATION["train"]
CONFIDENCES = (0.02, 0.03, 0.05, 0.1, 0.2, 0.3)


def seeing(name: str, sure: float, env: Any) -> Policy:
    """Return a built-in policy that sees by the detector from a confidence on."""
    return Seeing(make_policy(name, env), DetectorEyes(frozen_encoder("detector"), sure), env)


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.eyes", description=__doc__)
    parser.add_argument("--policy", action="append", help="(default: search and belief)")
    parser.add_argument("--split", action="append", choices=SPLITS, help="(default: both)")
    parser.add_argument("--sure", action="append", type=float, help=f"confidence (default: {CONFIDENCES})")
    parser.add_argument("--thin", type=int, default=1, metavar="N", help="play every Nth task only")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    print("| policy | split | sure from | success % | PLW % |", "|---|---|--:|--:|--:|", sep="\n")
    for name in options.policy or ("search", "belief"):
        for split in options.split or SPLITS:
            for sure in options.sure or CONFIDENCES:
                with progress_bar() as bar:
                    summary = evaluate(
                        partial(seeing, name, sure), split, "visual", seeds=[0], workers=options.workers,
                        tasks=evaluated_tasks(split)[:: options.thin],
                        progress=bar.counter(f"{name} on {split}, sure from {sure}"),
                    ).summary  # fmt: skip
                print(
                    f"| {name} | {split} | {sure} | {percent(summary.success_rate)} | {percent(summary.plw)} |",
                    flush=True,
                )


if __name__ == "__main__":
    main()
