"""The report's plots, as SVG text that stands in a page."""

import io
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from chmarl_pb.evaluation.result import Report
from chmarl_pb.evaluation.tables import title_of
from chmarl_pb.extras import needs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = ("#4c78a8", "#f58518", "#54a24b", "#b279a2", "#e45756", "#72b7b2", "#9d755d", "#8c8c8c")
_STYLE: Any = {
    "svg.fonttype": "none", "svg.hashsalt": "chmarl-pb", "font.family": "sans-serif", "font.size": 10,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True,
    "grid.color": "#e6e6e6",
}  # fmt: skip


def score_bars(reports: Sequence[Report]) -> str:
    """Return bars of PLW over splits, with the bootstrap intervals."""
    titles, splits = _names(reports), list(dict.fromkeys(report.settings["split"] for report in reports))
    figure, axes = _axes(8.5, 3.4)
    width = 0.8 / len(titles)
    for number, title in enumerate(titles):
        for place, split in enumerate(splits):
            for report in reports:
                if (title_of(report), report.settings["split"]) == (title, split):
                    _bar(axes, place + (number - (len(titles) - 1) / 2) * width, width, report, number)
    axes.set_xticks(range(len(splits)), splits)
    axes.set_ylabel("PLW (%)")
    axes.set_ylim(0, 100)
    axes.grid(axis="x", visible=False)
    handles = [axes.bar(0, 0, color=_colour(number), label=title) for number, title in enumerate(titles)]
    axes.legend(handles=handles, loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    return _svg(figure)


def _bar(axes: "Axes", x: float, width: float, report: Report, number: int) -> None:
    figure = report.summary.plw
    axes.bar(x, 100 * report.plw, 0.9 * width, color=_colour(number))
    if figure.low is not None and figure.high is not None:
        axes.vlines(x, 100 * figure.low, 100 * figure.high, color="#333333", linewidth=1)


def success_curves(reports: Sequence[Report]) -> str:
    """Return curves of the episodes of one split that are solved within a number of joint steps."""
    figure, axes = _axes(8.5, 3.0)
    for number, report in enumerate(reports):
        steps = np.arange(report.settings["options"]["max_steps"] + 1)
        ends = np.array([episode.steps if episode.success else np.inf for episode in report.episodes])
        shares = 100 * (ends[None, :] <= steps[:, None]).mean(axis=1)
        axes.plot(steps, shares, drawstyle="steps-post", color=_colour(number), label=title_of(report))
    axes.set_xlabel("joint steps")
    axes.set_ylabel("solved (%)")
    axes.set_ylim(0, 102)
    axes.set_xlim(left=0)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False)
    return _svg(figure)


def cooperation_bars(reports: Sequence[Report]) -> str:
    """Return bars of the share of the possible gain from cooperation; reports without reference are left out."""
    rows = [(report, report.cooperation) for report in reports]
    shares = [(f"{title_of(r)}, {r.settings['split']}", gain.share) for r, gain in rows if gain and gain.share]
    if not shares:
        return ""
    names, values = [name for name, _ in shares][::-1], [100 * value for _, value in shares][::-1]
    figure, axes = _axes(8.5, 0.6 + 0.28 * len(shares))
    axes.barh(names, values, color=["#54a24b" if value > 0 else "#e45756" for value in values])
    axes.axvline(0, color="#333333", linewidth=1)
    axes.set_xlabel("share of the possible gain in PLW over the lone humanoid (%)")
    axes.grid(axis="y", visible=False)
    return _svg(figure)


def _names(reports: Sequence[Report]) -> list[str]:
    return list(dict.fromkeys(title_of(report) for report in reports))


def _colour(number: int) -> str:
    return _COLOURS[number % len(_COLOURS)]


def _axes(width: float, height: float) -> tuple["Figure", "Axes"]:
    """Return an empty figure of a size in inches and its axes."""
    with needs("the report", "report"):
        import matplotlib
        from matplotlib.figure import Figure
    with matplotlib.rc_context(_STYLE):
        figure = Figure(figsize=(width, height))
        return figure, figure.add_subplot()


def _svg(figure: "Figure") -> str:
    import matplotlib

    buffer = io.StringIO()
    metadata: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}
    with matplotlib.rc_context(_STYLE):
        figure.savefig(buffer, format="svg", bbox_inches="tight", metadata=metadata)
    text = buffer.getvalue()
    return text[text.index("<svg") :]
