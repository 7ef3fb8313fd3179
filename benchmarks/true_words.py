"""What misread words cost: ``python -m benchmarks.true_words WEIGHTS``.

Plays weights that learned to read, on validation tasks and by the rules of their training, twice: with what they read,
and with what ``parse_instruction`` reads. Then prints which names they misread. Test splits are refused.
"""

import argparse
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from torch import Tensor, nn

from benchmarks.scores import Scores, parser_of, run
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.learning.networks.match import Match, Wanted, named_by
from chmarl_pb.learning.networks.parsed import Parsed
from chmarl_pb.learning.policies.learned import ValuePolicies
from chmarl_pb.learning.storage.checkpoint import CheckpointError
from chmarl_pb.policies.policy import Policy

Misread = Counter[tuple[str, str]]  # the class that is named, and the one that is read instead -> instructions


class Reading(nn.Module):
    """Reads as a network has learned to, or by the rule, and notes how the former reads.

    Attributes:
        heard: the instructions.
        misread: by the network, classes of X and of Y in these.
        wrong: number of instructions with such.
    """

    def __init__(self, match: Match, told: bool):
        """Take the place of what reads; ``told``: by the rule."""
        super().__init__()
        self._match, self._told = match, told
        self.heard, self.misread, self.wrong = set[bytes](), Misread(), 0

    def forward(self, tokens: Tensor, words: Any, classes: Any, colours: Any = None) -> Wanted:
        """Return what instructions (B, L) ask for."""
        read: Wanted = self._match(tokens, words, classes, colours)
        for row, wanted in zip(tokens.cpu().numpy(), read.classes, strict=True):
            self._note(row, wanted)
        if not self._told:
            return read
        parsed = Parsed(read.classes.shape[2], 0 if read.colours is None else read.colours.shape[2])
        found: Wanted = parsed(tokens)
        return found

    def _note(self, tokens: np.ndarray, classes: Tensor) -> None:
        if tokens.tobytes() in self.heard:
            return
        self.heard.add(tokens.tobytes())
        pairs = zip(named_by(tokens)[0].tolist(), classes.argmax(dim=1).tolist(), strict=True)
        names = BENCHMARK.rows
        other = [(names[named - 1].name, names[own - 1].name) for named, own in pairs if 0 < named != own]
        self.misread.update(other)
        self.wrong += bool(other)


def read_by(agents: nn.Module, told: bool) -> list[Reading]:
    """Let all agents read through a :class:`Reading`, and return these.

    Raises:
        CheckpointError: they have not learned to read.
    """
    found = list[Reading]()
    for part in list(agents.modules()):
        matches: Any = getattr(part, "matches", None)  # of an encoder
        for key in list(matches) if isinstance(matches, nn.ModuleDict) else ():
            if isinstance(match := matches[key], Match):
                found.append(Reading(match, told))
                matches[key] = found[-1]
    if not found:
        raise CheckpointError("these weights have not learned to read; give some of --graph-pool grounded")
    return found


class Readers:
    """Makes the policy of weights, and keeps what reads in it."""

    deterministic = True

    def __init__(self, weights: Path, told: bool):
        """Remember a file of weights, and whether the words are told."""
        self.inner, self.told = ValuePolicies(weights), told
        self.made = list[Reading]()

    def __call__(self, env: Any) -> Policy:
        """Return the policy for an environment."""
        policy: Any = self.inner(env)
        self.made += read_by(policy.batched.agents, self.told)
        return policy  # type: ignore[no-any-return]


def misread(readings: list[Reading]) -> list[dict[str, Any]]:
    """Return which classes are misread, by all agents, as shares of the instructions that each of them has heard."""
    heard = sum(len(reading.heard) for reading in readings)
    total = sum((reading.misread for reading in readings), Misread())
    each = [(named, own, count) for (named, own), count in total.most_common()]
    every = ("any of these", "", sum(reading.wrong for reading in readings))
    return [{"named": named, "read": own, "of instructions": count / heard} for named, own, count in (*each, every)]


def main() -> int:
    """Play and print."""
    return run(parser_of("benchmarks.true_words", __doc__, workers=1), _play)


def _play(chosen: argparse.Namespace) -> None:
    scores = Scores("words", chosen)
    for split in scores.splits:
        for name, told in (("as learned", False), ("by the rule", True)):
            readers = Readers(chosen.weights, told)
            scores.play(name, readers, split)
        scores.count(f"misread in {split}", misread(readers.made))


if __name__ == "__main__":
    raise SystemExit(main())
