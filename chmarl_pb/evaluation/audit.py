"""The shortcut audit: what policies score that do without eyes, words, feedback or the partner.

A row is a built-in policy and what is taken from it. A policy is *blind* if no robot of the team reads its picture or
graph, whatever else it knows. What the best of these scores shows no seeing, so a learner's score is to be read as its
gain over that.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import Any

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import OF_TRACK, PAPER, split_or_headline
from chmarl_pb.evaluation.audit_file import FORMAT, Audit, Line
from chmarl_pb.evaluation.json_file import check_replaceable
from chmarl_pb.evaluation.protocol import SEEDS, check_out, evaluate
from chmarl_pb.evaluation.result import Report
from chmarl_pb.executors import Executor
from chmarl_pb.policies.registry import BUILT_IN, PARTS
from chmarl_pb.tasks.symbols import Talk

#: What the rows stand beside: policies that use all, and the planner, which knows the world.
REFERENCES = ("reactive", "search", "belief", "planner")

#: Called after each finished episode with the row's name and the numbers of finished and of all its episodes.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class Row:
    """A policy, and what is taken from it.

    Attributes:
        policy: name of a built-in policy.
        changes: options of the environment that differ from the setting's.
        note: what these take or give.
    """

    policy: str
    changes: Mapping[str, Any] = field(default_factory=dict)
    note: str = ""

    @property
    def name(self) -> str:
        """The policy with the note."""
        return f"{self.policy}, {self.note}" if self.note else self.policy

    @property
    def slug(self) -> str:
        """The name as part of a file's name."""
        return self.name.replace(",", "").replace("'", "").replace(" ", "-")


def audit(
    split: str = OF_TRACK,
    track: str = PAPER,
    seeds: Sequence[int] = SEEDS,
    workers: int = 2,
    out: Path | str | None = None,
    progress: Progress = lambda row, finished, total: None,
    executor: Executor | None = None,
    **options: Any,
) -> Audit:
    """Play the shortcut policies and, beside them, policies that use what they are given.

    >>> found = chmarl_pb.audit("val-unseen", seeds=[0], workers=1, tasks=["val-unseen-000"])
    >>> found.best_blind.eyes
    False

    Args:
        split: all its tasks are played; of those for training, the first 250. If none is given, that of the track's
            headline.
        track: its rules are played; single ones may be given as options.
        seeds: each plays every task once; a deterministic policy plays the first only, see
            :func:`chmarl_pb.evaluate`.
        workers: number of processes.
        out: JSON file for the audit. The results of its rows lie in a folder of the same name without the ending; rows
            that are there already with the same settings are kept, so that the same call goes on after an interruption.
        progress: called after each episode.
        executor: where the work is done, e.g. a :class:`chmarl_pb.ray_executor.RayExecutor`; None: in ``workers``
            processes of this machine.
        **options: of :func:`chmarl_pb.evaluate`: ``observation``, ``tasks``, and those of the environment.

    Raises:
        OptionError: a split or an option is unknown, or ``out`` or the file of a row is a folder, or holds
            something else.
        BusyError: another process writes a result.
        WorkerError: a process died; finished episodes are kept.
        WriteError: a file cannot be written.
    """
    split = split_or_headline(split, track)
    given = {"track": track, **options}
    setting = Options(**{"split": split, **{name: value for name, value in given.items() if name != "tasks"}})
    file = None if out is None else Path(out)
    if file is not None:
        check_replaceable(file, FORMAT, "an audit")
    rows = rows_of(setting)
    paths = [None if file is None else check_out(file.with_suffix("") / f"{row.slug}.json") for row in rows]
    lines, reports = list[Line](), list[Report]()
    for row, path in zip(rows, paths, strict=True):
        report = evaluate(
            row.policy, split, seeds=seeds, workers=workers, out=path, reuse=True, progress=partial(progress, row.name),
            executor=executor, **{**given, **row.changes},
        )  # fmt: skip
        lines.append(_line(row, setting, report))
        reports.append(report)
    found = Audit.of(lines, track, reports)
    if file is not None:
        found.save(file)
    return found


def rows_of(setting: Options) -> tuple[Row, ...]:
    """Return the rows of the audit of a setting."""
    obedient = [Row("feedback-only")] if setting.feedback else []
    if setting.feedback and setting.feedback != "planner":
        obedient.append(Row("feedback-only", {"feedback": "planner"}, "planner's words"))
    narrow = (*_deprived("blind", setting), *obedient, Row("open-loop"), *_deprived("instruction-blind", setting))
    seeing = (Row("partner-blind"), *[Row("colour-blind")] * setting.lookalikes)
    return Row("random"), *narrow, *seeing, *map(Row, REFERENCES)


def _deprived(policy: str, setting: Options) -> Iterator[Row]:
    """Yield a policy with all that it uses, and without feedback, without messages, and without both.

    One that has feedback alone is left out, which tells it all that it can do: that is feedback-only.
    """
    given = [part for part in ("feedback", "messages") if part in uses(policy, setting)]
    for count in range(len(given) + 1):
        for parts in combinations(given, count):
            if parts != ("messages",) or (policy != "blind" and "feedback" not in given):
                yield Row(policy, dict.fromkeys(parts, False), " and ".join(f"no {part}" for part in parts))


def uses(policy: str, setting: Options) -> tuple[str, ...]:
    """Return the parts of what a robot is given that a built-in policy's choices depend on, in a setting."""
    heard = bool(setting.messages) and (BUILT_IN[policy].talks or not isinstance(setting.channel, Talk))
    absent = {*(() if heard else ("messages", "partner")), *(() if setting.feedback else ("feedback",))}
    return tuple(part for part in PARTS if part in BUILT_IN[policy].uses and part not in absent)


def _line(row: Row, setting: Options, report: Report) -> Line:
    """Return the scores of a row, and what it used."""
    left = [part for part in uses(row.policy, setting) if row.changes.get(part, True)]
    used = tuple(part for part in left if part != "partner" or "messages" in left)
    withheld = not any(row.changes.values())
    blind = withheld and "eyes" not in used and row.policy != "planner"
    summary, seeds = report.summary, len(report.settings["seeds"])
    return Line(row.name, used, blind, summary.success_rate, summary.plw, summary.length_on_success, seeds)
