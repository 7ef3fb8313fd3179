"""The report: results of evaluations as one HTML page that needs no network."""

from collections.abc import Sequence
from html import escape
from pathlib import Path
from string import Template

from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation import paper
from chmarl_pb.evaluation.plots import cooperation_bars, score_bars, success_curves
from chmarl_pb.evaluation.policies import BUILT_IN
from chmarl_pb.evaluation.replays import replays
from chmarl_pb.evaluation.result import Report, load_result
from chmarl_pb.evaluation.tables import group_table, paper_table, result_table, title_of
from chmarl_pb.files import write_atomically
from chmarl_pb.tasks.splits import SPLITS

_TEMPLATE = Path(__file__).parent / "report.html"


def write_report(sources: Sequence[Path], out: Path) -> int:
    """Gather results into one page; chosen episodes lie beside it as files; return the exit code.

    Args:
        sources: result files, or folders of them.
        out: page to write.

    Raises:
        ResultError: a file is not a result, or there is none.
        MissingExtraError: matplotlib is missing.
    """
    reports = sorted(map(load_result, _files(sources)), key=_order)
    if not reports:
        raise ResultError(f"no results in {', '.join(map(str, sources))}; `chmarl-pb evaluate --out` writes them")
    write_atomically(out, page(reports, out.with_name(f"{out.stem}_episodes")))
    print(out)
    return 0


def page(reports: Sequence[Report], folder: Path) -> str:
    """Return the page of results.

    Args:
        reports: the results.
        folder: for the episode files that the page links to.
    """
    return Template(_TEMPLATE.read_text(encoding="utf-8")).substitute(
        scores=score_bars(reports),
        results=result_table(reports),
        graphs=paper_table(paper.SCENE_GRAPH, reports, others=True),
        visual=paper_table(paper.VISUAL, reports, others=True),
        feedback=paper_table(paper.FEEDBACK, reports, others=False),
        curves="".join(_curves(reports)),
        cooperation=cooperation_bars(reports) or "<p>No reference lengths fit these results.</p>",
        groups="".join(map(_groups, reports)),
        replays=replays(reports, folder),
        sources="".join(map(_source, reports)),
    )


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


def _curves(reports: Sequence[Report]) -> list[str]:
    splits = dict.fromkeys(report.settings["split"] for report in reports)
    return [
        f"<h3>{split}</h3>{success_curves([report for report in reports if report.settings['split'] == split])}"
        for split in splits
    ]


def _groups(report: Report) -> str:
    name = f"{title_of(report)}, {report.settings['split']}, {report.settings['observation'].replace('_', ' ')}"
    tables = [group_table("home", report.per_home)]
    tables += [group_table(role, summaries) for role, summaries in report.per_class.items()]
    return f"<details><summary>{escape(name)}</summary>{''.join(tables)}</details>"


def _source(report: Report) -> str:
    run, settings = report.run, report.settings
    versions = ", ".join(f"{name} {version}" for name, version in run["versions"].items())
    lines = (
        f"{title_of(report)}, {settings['split']}: {run['command']}",
        f"{run['date']}, {run['seconds']} s with {run['workers']} workers on {run['machine']['processor']}",
        f"tasks {settings['tasks_sha256'][:12]}, source {settings['source_sha256'][:12]}; {versions}",
    )
    return f"<li>{'<br>'.join(map(escape, lines))}</li>"
