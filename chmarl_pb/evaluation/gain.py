"""What a score is worth beside policies that do not see: its gain over the best of them on the same split."""

from collections.abc import Sequence
from statistics import fmean

from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.evaluation.audit_file import Audit, Line, published_audit
from chmarl_pb.evaluation.result import Report

#: Options of the audit that may be off: who gets less may be compared with who gets more.
_LESS = ("messages", "feedback")


def best_blind(split: str, track: str = PAPER) -> Line | None:
    """Return the best blind policy of the audit that comes with the package; None without one."""
    found = published_audit(split, track)
    return found.best_blind if found else None


def gain(plws: Sequence[float], split: str, track: str = PAPER) -> float | None:
    """Return the mean of PLWs, 0 to 1, minus that of the best blind policy, in points; None if one is missing."""
    best = best_blind(split, track)
    return None if best is None or not plws else 100 * (fmean(plws) - (best.plw.mean or 0.0))


def gain_of(report: Report) -> float | None:
    """Return the gain of a result in points; None where no audit is of its tasks and rules."""
    settings = report.settings
    found = published_audit(settings["split"], report.track)
    if found is None or not _comparable(report, found):
        return None
    return 100 * (report.plw - (found.best_blind.plw.mean or 0.0))


def _comparable(report: Report, found: Audit) -> bool:
    """Return whether a result is of the tasks, homes and rules of an audit."""
    own, theirs = report.settings, found.settings
    free = ("image_size", *(name for name in _LESS if not own["options"][name]))
    rules = [{name: value for name, value in of["options"].items() if name not in free} for of in (own, theirs)]
    same = all(own[name] == theirs[name] for name in ("tasks_sha256", "homes_sha256"))
    return same and rules[0] == rules[1] and not report.foreign


def points(gained: float | None) -> str:
    """Return a gain as text, empty if there is none."""
    return "" if gained is None else f"{gained:+.1f}"
