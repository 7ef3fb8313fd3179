"""What directions from another robot are worth to a learner: ``python -m benchmarks.directions WEIGHTS``.

Plays weights of ``--cells-past`` on validation tasks by the rules that they were trained by, with the directions of X
and Y from another robot in the picture, and with zeros in their place. Test splits are refused.
"""

import argparse
from functools import partial
from pathlib import Path
from typing import Any

from torch import Tensor, nn

from benchmarks.scores import Scores, parser_of, run
from chmarl_pb.learning.networks import bearings, cells
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.storage.checkpoint import CheckpointError, load
from chmarl_pb.policies.policy import Policy


class Undirected:
    """Makes the policy of weights, which is told no directions; can be sent to other processes."""

    deterministic = True

    def __init__(self, weights: Path):
        """Remember a file of weights.

        Raises:
            CheckpointError: they are told no directions.
        """
        self.inner = ValuePolicies(weights)
        if not load(weights, "value")["config"].get("cells_past"):
            raise CheckpointError(f"{weights}: is told no directions; give weights that were trained with --cells-past")

    def __call__(self, env: Any) -> Policy:
        """Return the policy for an environment."""
        policy: Any = self.inner(env)
        hide_directions(policy.batched.agents)
        return policy  # type: ignore[no-any-return]


def hide_directions(agents: nn.Module) -> None:
    """Let all that tells agents of cells and directions tell zeros in the place of directions, its last numbers."""
    for part in agents.modules():
        if getattr(part, "locates", 0) == cells.SIZE + bearings.SIZE:  # without: of a detector that knows no robots
            part.places = partial(_without_directions, part.places)  # type: ignore[assignment]


def _without_directions(places: Any, *arguments: Any, **named: Any) -> Tensor:
    found: Tensor = places(*arguments, **named)
    found[:, -bearings.SIZE :] = 0
    return found


def main() -> int:
    """Play and print."""
    return run(parser_of("benchmarks.directions", __doc__), _play)


def _play(chosen: argparse.Namespace) -> None:
    rows = {"told": ValuePolicies(chosen.weights), "zeros": Undirected(chosen.weights)}
    scores = Scores("directions", chosen)
    for split in scores.splits:
        for name, policies in rows.items():
            scores.play(name, policies, split)


if __name__ == "__main__":
    raise SystemExit(main())
