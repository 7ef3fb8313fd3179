"""What a score is worth beside policies that do not see: its gain over the best of them on the same split."""

from collections.abc import Mapping, Sequence
from statistics import fmean
from typing import Any

from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.evaluation.audit_file import Audit, Line, published_audit
from chmarl_pb.evaluation.intervals import interval
from chmarl_pb.evaluation.metrics import Figure, by_home
from chmarl_pb.evaluation.result import Report
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.tidy_task import AnyTask

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


def gain_of(report: Report) -> Figure | None:
    """Return the gain of a result in points, with its interval over tasks, each of which both have played.

    Returns:
        None where no audit is of its tasks and rules, or the policy is told more than the blind ones.
    """
    found = published_audit(report.settings["split"], report.track)
    if found is None or not _comparable(report, found):
        return None
    return _over(found, [report.plw], report.plw_of_tasks)


def gain_of_runs(plws: Sequence[float], of_tasks: Sequence[Mapping[str, float]], split: str) -> Figure | None:
    """Return the gain of several trainings in points, with its interval where all tell what they had of each task.

    Args:
        plws: PLW of each training, 0 to 1.
        of_tasks: task's id -> PLW, of those trainings of which that is kept.
        split: the split, by the rules of the paper's track.
    """
    found = published_audit(split, PAPER)
    if found is None or not plws:
        return None
    whole = len(of_tasks) == len(plws)
    tasks: list[AnyTask] = [*load_tasks(split)] if whole else []
    return _over(found, plws, {task: fmean(plw[task.id] for plw in of_tasks) for task in tasks})


def is_of_audit(options: Mapping[str, Any], tasks_sha256: str, split: str) -> bool:
    """Return whether what was played on a split, of the paper's track, is of the tasks and rules of its audit.

    Args:
        options: of the environment, as results keep them.
        tasks_sha256: of the tasks.
        split: the split.
    """
    found = published_audit(split, PAPER)
    return found is not None and found.settings["tasks_sha256"] == tasks_sha256 and _by_same_rules(options, found)


def _over(found: Audit, plws: Sequence[float], of_tasks: Mapping[AnyTask, float]) -> Figure:
    mean = 100 * (fmean(plws) - (found.best_blind.plw.mean or 0.0))
    if not found.blind_plw or len(of_tasks) < 2:
        return Figure(mean)
    ahead = {task: 100 * (plw - found.blind_plw[task.id]) for task, plw in of_tasks.items()}
    return Figure(mean, None, *interval(by_home(ahead)))


def _comparable(report: Report, found: Audit) -> bool:
    """Return whether a result is of the tasks, homes and rules of an audit, by a policy that is told no more."""
    own, theirs = report.settings, found.settings
    same = all(own[name] == theirs[name] for name in ("tasks_sha256", "homes_sha256"))
    return same and _by_same_rules(own["options"], found) and not report.foreign and not report.privileged


def _by_same_rules(options: Mapping[str, Any], found: Audit) -> bool:
    """Return whether options of an environment are those of an audit, or give less."""
    free = ("image_size", *(name for name in _LESS if not options.get(name, True)))
    own, theirs = ({name: of[name] for name in of if name not in free} for of in (options, found.settings["options"]))
    return own == theirs
