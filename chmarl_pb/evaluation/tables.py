"""The report's tables: the paper's numbers beside ours in the same layout, and all results one by one."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from pathlib import Path
from statistics import fmean

import numpy as np

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.evaluation.as_text import interval_text, points
from chmarl_pb.evaluation.cooperation import Score, reference_scores, reference_scores_by_wording
from chmarl_pb.evaluation.gain import gain_of
from chmarl_pb.evaluation.metrics import Figure, Summary
from chmarl_pb.evaluation.paper import SPLITS, PaperTable, Row
from chmarl_pb.evaluation.provenance import tasks_hash
from chmarl_pb.evaluation.result import Report
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.policies.registry import BUILT_IN, SEARCHES, SHORTCUTS
from chmarl_pb.tasks.language import WORDINGS
from chmarl_pb.tasks.splits import STREAM, homes_of

_NONE = "-"
_WITHOUT_PIXELS = {"scene_graph", "text"}  # observations that do not depend on the size of pictures


def paper_table(table: PaperTable, reports: Sequence[Report], others: bool) -> str:
    """Return one of the paper's tables as HTML; each cell holds the paper's number and, below it, ours.

    Args:
        table: of the paper.
        reports: our results.
        others: whether to add rows for those of our results that the paper has no row for, and for policies that come
            with the benchmark: what can be scored with much less than a robot is given.
    """
    rows = [_paper_row(table, row, reports) for row in table.rows]
    if others:
        rows += _other_rows(table, reports) + _built_in_rows(table, reports)
    groups = "".join(f'<th colspan="{len(SPLITS)}">{name} (%)</th>' for name in ("Success rate", "PLW"))
    splits = "".join(f"<th>{split}</th>" for split in SPLITS * 2)
    head = f'<tr><th rowspan="2">policy</th><th rowspan="2"></th>{groups}</tr><tr>{splits}</tr>'
    return f"<h3>{escape(table.title)}</h3>{_table(head, rows)}"


def _paper_row(table: PaperTable, row: Row, reports: Sequence[Report]) -> str:
    same = [report for report in reports if _stands_beside(row, report)]
    name = row.name
    if len({(other.observation, other.feedback) for other in table.rows}) > 1:
        name = f"{row.observation.replace('_', ' ')}, {'feedback' if row.feedback else 'none'}"
    paper = "".join(f"<td>{value:.2f}</td>" for value in (*row.success, *row.plw))
    return (
        f'<tr class="paper"><th rowspan="2">{escape(name)}</th><td class="whose">paper</td>{paper}</tr>'
        f'<tr class="ours">{_whose(same)}{_our_cells(same)}</tr>'
    )


def _stands_beside(row: Row, report: Report) -> bool:
    settings = report.settings
    options = settings["options"]
    return (
        not _apart(report)
        and not report.privileged
        and (row.centralized or not settings.get("centralized"))
        and label_of(report).casefold() == row.name.casefold()
        and settings["observation"] == row.observation
        and bool(options["feedback"]) == row.feedback
        and bool(options["messages"]) == row.messages
    )


def _other_rows(table: PaperTable, reports: Sequence[Report]) -> list[str]:
    """Return rows of our results of the table's observation and splits that stand beside none of its rows."""
    observation = table.rows[0].observation
    left: dict[str, list[Report]] = {}
    for report in reports:
        fits = report.settings["observation"] == observation and not _other_homes(report)
        if fits and not any(_stands_beside(row, report) for row in table.rows):
            left.setdefault(title_of(report), []).append(report)
    return [
        f'<tr class="ours"><th>{escape(name)}</th>{_whose(same)}{_our_cells(same)}</tr>' for name, same in left.items()
    ]


def _built_in_rows(table: PaperTable, reports: Sequence[Report]) -> list[str]:
    """Return rows of the built-in policies that no result of the table's observation is of."""
    observation = table.rows[0].observation
    given = {title_of(report) for report in reports if report.settings["observation"] == observation}
    scores = {split: reference_scores(split, MAX_STEPS) for split in SPLITS}
    rows = []
    for name, what in {**SHORTCUTS, **SEARCHES}.items():
        if name not in given and all(name in of_split for of_split in scores.values()):
            cells = "".join(_reference_cell(split, name, metric) for metric in Score._fields for split in SPLITS)
            told = ", told the true classes" * (observation != "scene_graph" and BUILT_IN[name].reads_graphs)
            note = f"<br><small>{what}{told}</small>"
            rows.append(f'<tr class="built-in"><th>{name}{note}</th><td class="whose">built in</td>{cells}</tr>')
    return rows


def _reference_cell(split: str, policy: str, metric: str) -> str:
    scores = reference_scores_by_wording(split, MAX_STEPS)
    means = {name: getattr(same[policy], metric) for name, same in scores.items() if same}
    whole = getattr(reference_scores(split, MAX_STEPS)[policy], metric)
    return f"<td>{100 * whole:.2f}{_by_wording(means)}</td>"


def _whose(reports: Sequence[Report]) -> str:
    """Return the cell that says whose numbers a row has, and whether those of a split are of several versions."""
    of_split = ([report for report in reports if report.settings["split"] == split] for split in SPLITS)
    notes = dict.fromkeys(filter(None, map(versions_note, of_split)))
    return f'<td class="whose">ours{"".join(f"<br><small>{escape(note)}</small>" for note in notes)}</td>'


def _our_cells(reports: Sequence[Report]) -> str:
    cells = []
    for metric in ("success_rate", "plw"):
        for split in SPLITS:
            same = [report for report in reports if report.settings["split"] == split]
            values = [100 * getattr(report, metric) for report in same]
            cells.append(f"<td>{_mean_of(values)}{_by_wording(_means(same, metric))}</td>")
    return "".join(cells)


def _mean_of(values: Sequence[float]) -> str:
    if not values:
        return _NONE
    deviation = f"<small> ± {np.std(values, ddof=1):.2f}</small>" if len(values) > 1 else ""
    return f"{np.mean(values):.2f}{deviation}"


def _means(reports: Sequence[Report], metric: str) -> dict[str, float]:
    """Return wording of the instructions -> a metric's mean over results, 0 to 1."""
    summaries = {name: [one.per_wording[name] for one in reports if name in one.per_wording] for name in WORDINGS}
    return {name: fmean(getattr(one, metric).mean or 0 for one in same) for name, same in summaries.items() if same}


def _by_wording(means: Mapping[str, float]) -> str:
    """Return a line with a score for seen and for held-out wording; none if there is but one of them."""
    parts = [f"{name} {100 * mean:.1f}" for name, mean in means.items()]
    return f"<br><small>{', '.join(parts)}</small>" if len(parts) > 1 else ""


def result_table(reports: Sequence[Report]) -> str:
    """Return a table of all results, one row each."""
    head = (
        "<tr><th>policy</th><th>split</th><th>observation</th><th>tasks</th><th>seeds</th><th>success %</th>"
        "<th>PLW %</th><th>success / PLW %<br>by wording</th><th>steps<br>if solved</th>"
        "<th>final<br>potential</th><th>gain from<br>cooperation</th>"
        "<th>gain over the<br>best blind</th></tr>"
    )
    return _table(head, map(_result_row, reports))


def _result_row(report: Report) -> str:
    settings, summary = report.settings, report.summary
    gain = report.cooperation
    share = _NONE if gain is None or gain.share is None else f"{100 * gain.share:.0f} %"
    values = (
        escape(where_of(report)), settings["observation"].replace("_", " "), settings["tasks"], len(settings["seeds"]),
        _rate(summary.success_rate), _rate(summary.plw), _both(report), _plain(summary.length_on_success),
        _plain(summary.final_potential), share, _gained(report),
    )  # fmt: skip
    policy = str(settings["policy"])
    source = "" if label_of(report) == policy else f"<br><small>{escape(policy)}</small>"
    cells = "".join(f"<td>{value}</td>" for value in values)
    return f"<tr><th>{escape(title_of(report))}{source}</th>{cells}</tr>"


def _gained(report: Report) -> str:
    """Return the gain over the best blind policy, with its interval."""
    gained = gain_of(report)
    if gained is None:
        return _NONE
    between = interval_text(gained)
    return points(gained.mean) + (f"<br><small>{between}</small>" if between else "")


def _both(report: Report) -> str:
    """Return the scores for seen and for held-out wording."""
    lines = (
        f"{name}: {100 * (summary.success_rate.mean or 0):.1f} / {100 * (summary.plw.mean or 0):.1f}"
        for name, summary in report.per_wording.items()
    )
    return "<br>".join(lines)


def group_table(title: str, summaries: dict[str, Summary]) -> str:
    """Return a table of the metrics of homes or classes."""
    head = f"<tr><th>{escape(title)}</th><th>episodes</th><th>success %</th><th>PLW %</th><th>steps if solved</th></tr>"
    rows = (
        f"<tr><th>{escape(name.replace('_', ' '))}</th><td>{summary.episodes}</td>"
        f"<td>{_rate(summary.success_rate)}</td><td>{_rate(summary.plw)}</td><td>{_plain(summary.length_on_success)}</td></tr>"
        for name, summary in summaries.items()
    )
    return _table(head, rows)


def label_of(report: Report) -> str:
    """Return the label under which a result is shown: the given one, else the policy's name."""
    return str(report.run.get("label") or report.settings["policy"])


def title_of(report: Report) -> str:
    """Return a result's label and what sets it apart: what was switched off or given, and other tasks or limits."""
    notes = notes_of(report)
    return label_of(report) + (f" ({', '.join(notes)})" if notes else "")


def notes_of(report: Report) -> list[str]:
    """Return what sets a result apart, see :func:`title_of`."""
    off = [f"no {name}" for name in report.without]
    return [*off, *_apart(report), *([report.declared] if report.declared else [])]


def where_of(report: Report) -> str:
    """Return where a result was played: the split, or the homes that are none of its own."""
    return _other_homes(report) or str(report.settings["split"])


def _other_homes(report: Report) -> str:
    """Return the names of the homes of a result that its split does not play in, as those of the user's are."""
    split, homes = report.settings["split"], report.settings["homes_sha256"]
    known = homes if split == STREAM else homes_of(split)
    return ", ".join(Path(home).stem for home in homes if home not in known)


def _apart(report: Report) -> list[str]:
    """Return why a result cannot stand beside the paper's: other options, chosen tasks, a changed environment."""
    settings, options = report.settings, report.settings["options"]
    pixels = options.get("image_size", Options.image_size)
    whole = settings["tasks_sha256"] == tasks_hash(evaluated_tasks(settings["split"]))
    notes = {
        "goal observed": options.get("goal"),
        f"changed: {report.changed}": bool(report.changed),
        f"{pixels} px": _shows_pictures(settings["observation"]) and pixels != Options.image_size,
        f"{settings['tasks']} chosen tasks: {settings['tasks_sha256'][:4]}": not whole,
        f"in {_other_homes(report)}": bool(_other_homes(report)),
        f"at most {options['max_steps']} steps": options["max_steps"] != report.rules["max_steps"],
    }
    return [note for note, holds in notes.items() if holds]


def _shows_pictures(observation: str) -> bool:
    """Return whether something is observed that has pixels, as sensors of one's own may."""
    return not _WITHOUT_PIXELS.issuperset(observation.split("+"))


def versions_note(reports: Sequence[Report]) -> str:
    """Return a note where results that are averaged were made by more than one version of the source; else nothing."""
    versions = sorted({report.settings["source_sha256"][:8] for report in reports})
    return f"by {len(versions)} versions of the source: {', '.join(versions)}" if len(versions) > 1 else ""


def _table(head: str, rows: Iterable[str]) -> str:
    return f'<div class="wide"><table><thead>{head}</thead><tbody>{"".join(rows)}</tbody></table></div>'


def _rate(figure: Figure) -> str:
    """Return mean, deviation over seeds and interval of a rate in per cent."""
    if figure.mean is None:
        return _NONE
    text = f"{100 * figure.mean:.2f}"
    if figure.deviation is not None:
        text += f"<small> ± {100 * figure.deviation:.2f}</small>"
    if figure.low is not None and figure.high is not None:
        text += f"<br><small>{100 * figure.low:.1f} to {100 * figure.high:.1f}</small>"
    return text


def _plain(figure: Figure) -> str:
    return _NONE if figure.mean is None else f"{figure.mean:.1f}"
