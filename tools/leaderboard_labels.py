"""Whose a label of the leaderboard is: results of one label are averaged, so they are to be of one policy."""

import re
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from chmarl_pb.evaluation.labels import are_alike, label_fault
from chmarl_pb.evaluation.result import Report
from chmarl_pb.evaluation.tables import label_of
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.policies.weights import published_names

_NUMBERS = re.compile(r"\d+")
_EYES = "@"  # between the names of a built-in policy and of its eyes


@dataclass(frozen=True)
class Sender:
    """What a file tells of whose it is.

    Attributes:
        path: of the file.
        label: of its row.
        policy: what was evaluated, as ``--policy`` takes it.
        row: what the results of one row have in common beside the label.
    """

    path: Path
    label: str
    policy: str
    row: tuple[str, ...]

    @property
    def name(self) -> str:
        """The file's name up to the first hyphen, without numbers: ``mine`` of ``mine-paper-seed0.json``."""
        return _NUMBERS.sub("", self.path.stem.partition("-")[0])


def is_not_free(report: Report, trained: Iterable[str]) -> str:
    """Return why a result cannot have its label; empty if it can.

    Args:
        report: the result.
        trained: names of the rows that were trained here.
    """
    label, policy = label_of(report), report.settings["policy"]
    if fault := label_fault(label):
        return f"its label {label!r} {fault}"
    if any(are_alike(label, name) for name in trained):
        return f"{label!r} is the name of a row that was trained here"
    ours = (*BUILT_IN, *published_names())
    if label != policy and any(are_alike(label.partition(_EYES)[0], name) for name in ours):
        return f"{label!r} is the name of a policy of this package, and the result is of {policy}"
    return ""


def other_owner(sender: Sender, others: Iterable[Sender]) -> Sender | None:
    """Return whose a label is already; None if it is free, or that of the same policy."""
    return next((one for one in others if are_alike(one.label, sender.label) and not _are_one(one, sender)), None)


def _are_one(one: Sender, other: Sender) -> bool:
    """Return whether two results of one label are of one policy: its name and the files' are, but for their numbers.

    In two rows, as of graphs and of pictures, one of the two names is enough.
    """
    agree = _NUMBERS.sub("", one.policy) == _NUMBERS.sub("", other.policy), one.name == other.name
    return all(agree) if one.row == other.row else any(agree)
