"""The report: results of evaluations as one HTML page that needs no network."""

import shutil
from collections.abc import Iterator, Sequence
from html import escape
from pathlib import Path
from string import Template

from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.errors import OptionError, ResultError
from chmarl_pb.evaluation import paper
from chmarl_pb.evaluation.cooperation import reference_scores
from chmarl_pb.evaluation.groups import Group, grouped
from chmarl_pb.evaluation.plots import cooperation_bars, score_bars, success_curves
from chmarl_pb.evaluation.replays import replays
from chmarl_pb.evaluation.result import Report, load_result
from chmarl_pb.evaluation.tables import (
    group_table,
    label_of,
    paper_table,
    result_table,
    title_of,
    versions_note,
    where_of,
)
from chmarl_pb.files import write_atomically
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.tasks.splits import SPLITS

_TEMPLATE = Path(__file__).parent / "report.html"
_BLIND = "blind"  # marked in the plots: what needs neither observation nor instruction


def write_report(sources: Sequence[Path], out: Path) -> int:
    """Gather results into one page; chosen episodes lie beside it as files; return the exit code.

    Args:
        sources: result files, or folders of them.
        out: page to write.

    Raises:
        ResultError: a file is not a result, or there is none.
        OptionError: the page would be no file.
        MissingExtraError: matplotlib is missing.
    """
    reports = sorted(_different(_files(sources)), key=_order)
    if not reports:
        raise ResultError(f"no results in {', '.join(map(str, sources))}; `chmarl-pb evaluate --out` writes them")
    if out.exists() and not out.is_file():
        raise OptionError(f"{out}: episodes lie beside a page, so it has to be a file; name another")
    folder = out.with_name(f"{out.stem}_episodes")
    is_new = not folder.exists()
    try:
        write_atomically(out, page(reports, folder))
    except BaseException:
        if is_new:
            shutil.rmtree(folder, ignore_errors=True)
        raise
    print(out)
    return 0


def page(reports: Sequence[Report], folder: Path) -> str:
    """Return the page of results.

    Args:
        reports: the results.
        folder: for the episode files that the page links to.
    """
    groups = grouped(reports)
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        scores="".join([*_scores(groups), *_mixed(groups)]),
        results=result_table(reports),
        graphs=paper_table(paper.SCENE_GRAPH, reports, others=True),
        visual=paper_table(paper.VISUAL, reports, others=True),
        feedback=paper_table(paper.FEEDBACK, reports, others=False),
        curves="".join(_curves(groups)),
        cooperation="".join(_cooperation(groups)) or "<p>No reference lengths fit these results.</p>",
        groups="".join(map(_groups, reports)),
        replays=replays(reports, folder),
        sources="".join(map(_source, reports)),
    )


def _different(files: Sequence[Path]) -> Iterator[Report]:
    """Yield the results of files; one that is there twice, as a copy, is no second training and counts once."""
    known = dict[tuple[str, str], Path]()
    for path in files:
        report = load_result(path)
        first = known.setdefault((label_of(report), report.sha256), path)
        if first is path:
            yield report
        else:
            print(f"{path} is the same result as {first} and counts once")


def _files(sources: Sequence[Path]) -> list[Path]:
    found: list[Path] = []
    for source in sources:
        found += sorted(source.glob("*.json")) if source.is_dir() else [source]
    return list(dict.fromkeys(found))


def _order(report: Report) -> tuple[int, str, int, str]:
    """Sort by split, observation, then learners before the built-in policies from weak to strong."""
    settings, names = report.settings, list(BUILT_IN)
    place = names.index(settings["policy"]) if settings["policy"] in names else -1
    return SPLITS.index(settings["split"]), settings["observation"], place, title_of(report)


def _scores(groups: Sequence[Group]) -> Iterator[str]:
    usual = {group.split for group in groups if all(map(_is_usual, group.reports))}
    known = {split: reference_scores(split, MAX_STEPS) for split in usual if split in SPLITS}
    blind = {split: {_BLIND: scores[_BLIND].plw} for split, scores in known.items() if _BLIND in scores}
    for observation, same in _by_observation(groups).items():
        yield f"<h3>{_words(observation)}</h3><div class='wide plot'>{score_bars(same, blind)}</div>"


def _mixed(groups: Sequence[Group]) -> Iterator[str]:
    """Yield a line for each group whose results are of several versions of the source."""
    for group in groups:
        if note := versions_note(group.reports):
            whose = f"{group.title}, {group.split}, {_words(group.observation)}"
            yield f"<p><small>{escape(f'{whose}: {len(group.reports)} results {note}')}</small></p>"


def _is_usual(report: Report) -> bool:
    """Return whether a result is by the rules that the references were played by."""
    return not report.changed and bool(report.settings["options"]["max_steps"] == MAX_STEPS)


def _curves(groups: Sequence[Group]) -> Iterator[str]:
    for split in dict.fromkeys(group.split for group in groups):
        for observation, same in _by_observation([group for group in groups if group.split == split]).items():
            yield f"<h3>{escape(split)}, {_words(observation)}</h3><div class='wide plot'>{success_curves(same)}</div>"


def _cooperation(groups: Sequence[Group]) -> Iterator[str]:
    for observation, same in _by_observation(groups).items():
        if bars := cooperation_bars(same):
            yield f"<h3>{_words(observation)}</h3><div class='wide plot'>{bars}</div>"


def _by_observation(groups: Sequence[Group]) -> dict[str, list[Group]]:
    """Return observation -> its groups: what one picture shows was observed in one way."""
    found: dict[str, list[Group]] = {}
    for group in groups:
        found.setdefault(group.observation, []).append(group)
    return dict(sorted(found.items()))


def _words(observation: str) -> str:
    return observation.replace("_", " ")


def _groups(report: Report) -> str:
    name = f"{title_of(report)}, {where_of(report)}, {_words(report.settings['observation'])}"
    tables = [group_table("wording", report.per_wording), group_table("home", report.per_home)]
    tables += [group_table(role, summaries) for role, summaries in report.per_class.items()]
    return f"<details><summary>{escape(name)}</summary>{''.join(tables)}</details>"


def _source(report: Report) -> str:
    run, settings = report.run, report.settings
    versions = ", ".join(f"{name} {version}" for name, version in run["versions"].items())
    lines = (
        f"{title_of(report)}, {where_of(report)}: {run['command']}",
        f"{run['date']}, {run['seconds']} s with {run['workers']} workers on {run['machine']['processor']}",
        f"tasks {settings['tasks_sha256'][:12]}, source {settings['source_sha256'][:12]}; {versions}",
    )
    return f"<li>{'<br>'.join(map(escape, lines))}</li>"
