"""Results that belong together: one policy's name in one setting, several if it was trained with several seeds."""

import hashlib
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from statistics import fmean

from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.result import Report
from chmarl_pb.evaluation.tables import title_of, where_of

_Key = tuple[str, str, str, str]


@dataclass(frozen=True)
class Group:
    """Results of one name on one split in one setting; other tasks, homes or options make another group.

    Their source may be of several versions, as :func:`chmarl_pb.evaluation.tables.versions_note` says.

    Attributes:
        title: name and what sets the setting apart.
        split: that was played, or other homes than its own.
        observation: "scene_graph" or "visual".
        reports: the results, one for each training seed.
    """

    title: str
    split: str
    observation: str
    reports: tuple[Report, ...]


@dataclass(frozen=True)
class Bar:
    """What a bar of a plot shows, in per cent.

    Attributes:
        mean: over the results.
        points: each of them.
        low: lower end of the interval over tasks; None with several results, whose points show their spread.
        high: upper end.
    """

    mean: float
    points: tuple[float, ...]
    low: float | None = None
    high: float | None = None


def grouped(reports: Sequence[Report]) -> list[Group]:
    """Return the groups of results, in the order of their first ones."""
    members: dict[_Key, list[Report]] = {}
    for report in reports:
        members.setdefault(_key(report), []).append(report)
    groups = [Group(*key[:3], tuple(same)) for key, same in members.items()]
    shown = Counter(key[:3] for key in members)
    return [
        group if shown[key[:3]] == 1 else replace(group, title=f"{group.title} (homes {key[3]})")
        for key, group in zip(members, groups, strict=True)
    ]


def _key(report: Report) -> _Key:
    settings = report.settings
    homes = hashlib.sha256(str(settings.get("homes_sha256")).encode()).hexdigest()[:4]
    return title_of(report), where_of(report), settings["observation"], homes


def bar_of(group: Group, value: Callable[[Report], float | None], interval: Callable[[Report], Figure]) -> Bar | None:
    """Return the bar of a group; None if none of its results has a value.

    Args:
        group: the results.
        value: of one result, 0 to 1.
        interval: of one result, with the ends of its interval.
    """
    points = [100 * number for number in map(value, group.reports) if number is not None]
    if not points:
        return None
    ends = interval(group.reports[0])
    if len(group.reports) > 1 or ends.low is None or ends.high is None:
        return Bar(fmean(points), tuple(points))
    return Bar(fmean(points), tuple(points), 100 * ends.low, 100 * ends.high)
