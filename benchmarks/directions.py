"""What directions from another robot are worth to a learner: ``python -m benchmarks.directions WEIGHTS``.

Plays weights of ``--cells-past`` on validation tasks by the rules that they were trained by, with the directions of X
and Y from another robot in the picture, and with zeros in their place. Prints success and PLW. Test splits are refused.
"""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from torch import Tensor, nn

from benchmarks.dials import advance
from chmarl_pb.cli.evaluate import percent, progress_bar
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.learning.networks.bearings import SIZE
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.policies.policy import Policy

SPLITS = ("generated-val", "val-seen", "val-unseen")


class Undirected:
    """Makes the policy of weights, which is told no directions; can be sent to other processes."""

    deterministic = True

    def __init__(self, weights: Path):
        """Remember a file of weights."""
        self.inner = ValuePolicies(weights)

    def __call__(self, env: Any) -> Policy:
        """Return the policy for an environment."""
        policy: Any = self.inner(env)
        hide_directions(policy.batched.agents)
        return policy  # type: ignore[no-any-return]


def hide_directions(agents: nn.Module) -> None:
    """Let all that tells agents of cells and directions tell zeros in the place of directions, its last numbers."""
    for part in agents.modules():
        if getattr(part, "locates", 0):
            part.places = partial(_without_directions, part.places)  # type: ignore[assignment]


def _without_directions(places: Any, *arguments: Any, **named: Any) -> Tensor:
    found: Tensor = places(*arguments, **named)
    found[:, -SIZE:] = 0
    return found


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.directions", description=__doc__)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--observation", default="scene_graph")
    parser.add_argument("--split", default=SPLITS[0], choices=SPLITS)
    parser.add_argument("--thin", type=int, default=5, metavar="N", help="play every Nth task only")
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    rules = ValuePolicies(options.weights).rules or {}
    print("| directions | success % | PLW % |", "|---|--:|--:|", sep="\n", flush=True)
    for name, policies in (("told", ValuePolicies(options.weights)), ("zeros", Undirected(options.weights))):
        with progress_bar() as bar:
            row = bar.add_task(name, total=None)
            summary = evaluate(
                policies, options.split, options.observation, seeds=[0], workers=options.workers,
                tasks=evaluated_tasks(options.split)[:: options.thin], progress=partial(advance, bar, row), **rules,
            ).summary  # fmt: skip
        print(f"| {name} | {percent(summary.success_rate)} | {percent(summary.plw)} |", flush=True)


if __name__ == "__main__":
    main()
