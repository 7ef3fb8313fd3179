"""Tracks: options that belong together; apart from the others, so that registering the ids imports next to nothing."""

from enum import Enum
from typing import Any

MAX_STEPS = 28  # joint steps: the random policy is to solve at most 3 per cent of test-unseen, see docs/benchmark.md
GROUNDED_STEPS = 28  # the fewest from which on more help the belief search little, see docs/benchmark.md


class _Unset(Enum):
    OF_TRACK = "as the track has it"


#: In place of an option's value: that of the track.
OF_TRACK: Any = _Unset.OF_TRACK

#: Track -> what its environments are given where an option is not.
TRACKS: dict[str, dict[str, Any]] = {
    "paper": {
        "split": "train", "messages": True, "feedback": True, "max_steps": MAX_STEPS, "pointing": False,
        "lookalikes": False, "templates": 1,
    },
    "grounded": {
        "split": "generated", "messages": "symbols", "feedback": False, "max_steps": GROUNDED_STEPS, "pointing": True,
        "lookalikes": True, "templates": 2,
    },
}  # fmt: skip
PAPER, GROUNDED = TRACKS

#: Track -> split on which its scores are compared.
HEADLINE_SPLITS = {PAPER: "test-unseen", GROUNDED: "generated-test"}


def split_or_headline(split: str, track: str) -> str:
    """Return a split, or in the place of ``OF_TRACK`` that of a track's headline; "" if there is no such track."""
    return HEADLINE_SPLITS.get(track, "") if split is OF_TRACK else split
