"""The report's plots, as SVG text that stands in a page."""

import io
from collections.abc import Callable, Sequence
from functools import wraps
from typing import TYPE_CHECKING, Any, ParamSpec

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.evaluation.groups import Bar, Group, bar_of
from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.result import Report
from chmarl_pb.extras import needs

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Drawing

_COLOURS = ("#4c78a8", "#f58518", "#54a24b", "#b279a2", "#e45756", "#72b7b2", "#9d755d", "#8c8c8c")
_DASHES = ("-", "--", ":", "-.")  # when the colours are used up
_GOOD, _BAD, _MARK = "#4c78a8", "#e45756", "#333333"
_STYLE: Any = {
    "svg.fonttype": "none", "svg.hashsalt": "chmarl-pb", "font.family": "sans-serif", "font.size": 10,
    "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True,
    "grid.color": "#e6e6e6", "axes.titlesize": 10, "axes.titlelocation": "left", "axes.titlepad": 10,
}  # fmt: skip
_PANEL, _LABELS, _ROW = 2.6, 2.6, 0.26  # inches: width of a panel and of the names, height of a row


Given = ParamSpec("Given")


def _styled(draw: Callable[Given, str]) -> Callable[Given, str]:
    """Let a function draw in the report's style.

    Raises:
        MissingExtraError: when it is called, if matplotlib is missing.
    """

    @wraps(draw)
    def styled(*args: Given.args, **kwargs: Given.kwargs) -> str:
        with needs("the report", "report"):
            import matplotlib
        with matplotlib.rc_context(_STYLE):
            return draw(*args, **kwargs)

    return styled


def _figure(width: float, height: float) -> "Drawing":
    from matplotlib.figure import Figure as Drawing

    return Drawing(figsize=(width, height), layout="constrained")


@_styled
def score_bars(groups: Sequence[Group], references: dict[str, dict[str, float]]) -> str:
    """Return bars of PLW, a panel for each split.

    Args:
        groups: results of one observation.
        references: split -> name -> PLW, 0 to 1, that is marked by a line across all rows.
    """
    rows = bar_rows(groups, lambda report: report.plw, lambda report: report.summary.plw)
    return _panels(rows, "PLW (%)", (0, 100), references)


@_styled
def cooperation_bars(groups: Sequence[Group]) -> str:
    """Return bars of the share of the possible gain from cooperation; empty if there are no reference lengths."""

    def share(report: Report) -> float | None:
        return report.cooperation.share if report.cooperation else None

    rows = bar_rows(groups, share, lambda report: Figure(None))
    return _panels(rows, "% of the possible gain", None, {}) if rows else ""


def bar_rows(
    groups: Sequence[Group], value: Callable[[Report], float | None], interval: Callable[[Report], Figure]
) -> dict[str, dict[str, Bar]]:
    """Return title -> split -> bar; every group that has values has a bar of its own."""
    rows: dict[str, dict[str, Bar]] = {}
    for group in groups:
        bar = bar_of(group, value, interval)
        if bar is not None:
            rows.setdefault(group.title, {})[group.split] = bar
    return rows


def _panels(
    rows: dict[str, dict[str, Bar]], label: str, limits: tuple[float, float] | None, references: dict[str, Any]
) -> str:
    """Return rows of bars, a panel for each split that has one."""
    splits = list(dict.fromkeys(split for bars in rows.values() for split in bars))
    figure = _figure(_LABELS + _PANEL * len(splits), 0.9 + _ROW * len(rows))
    panels = figure.subplots(1, len(splits), sharey=True, sharex=True, squeeze=False)[0]
    for axes, split in zip(panels, splits, strict=True):
        for number, bars in enumerate(rows.values()):
            if split in bars:
                _bar(axes, number, bars[split])
        _reference_lines(axes, references.get(split, {}))
        axes.set_title(split, pad=18 if references.get(split) else None)
        axes.set_xlabel(label)
        axes.grid(axis="y", visible=False)
        axes.tick_params(axis="y", length=0)
        axes.axvline(0, color=_MARK, linewidth=0.8)
    panels[0].set_yticks(range(len(rows)), list(rows))
    panels[0].set_ylim(len(rows) - 0.4, -0.6)
    if limits:
        panels[0].set_xlim(*limits)
    return _svg(figure)


def _bar(axes: "Axes", place: int, bar: Bar) -> None:
    axes.barh(place, bar.mean, 0.72, color=_GOOD if bar.mean >= 0 else _BAD, alpha=0.75)
    if len(bar.points) > 1:
        axes.plot(bar.points, [place] * len(bar.points), "o", color=_MARK, markersize=2.5)
    if bar.low is not None and bar.high is not None:
        axes.hlines(place, bar.low, bar.high, color=_MARK, linewidth=1)


def _reference_lines(axes: "Axes", references: dict[str, float]) -> None:
    for name, value in references.items():
        axes.axvline(100 * value, color=_BAD, linewidth=1, linestyle="--")
        where = axes.get_xaxis_transform()
        axes.text(100 * value, 1.01, name, color=_BAD, fontsize=8, ha="center", va="bottom", transform=where)


@_styled
def success_curves(groups: Sequence[Group]) -> str:
    """Return curves of the episodes that are solved within a number of joint steps, mean over the results of a group.

    Args:
        groups: results of one split and one observation.
    """
    figure = _figure(8.5, max(3.0, 0.6 + 0.19 * len(groups)))
    axes = figure.add_subplot()
    for number, group in enumerate(groups):
        colour, dash = _COLOURS[number % len(_COLOURS)], _DASHES[number // len(_COLOURS) % len(_DASHES)]
        steps, shares = solved_within(group)
        axes.plot(steps, shares, dash, drawstyle="steps-post", color=colour, label=group.title)
    axes.set_xlabel("joint steps")
    axes.set_ylabel("solved (%)")
    axes.set_ylim(0, 102)
    axes.set_xlim(left=0)
    axes.legend(loc="center left", bbox_to_anchor=(1, 0.5), frameon=False, fontsize=9)
    return _svg(figure)


def solved_within(group: Group) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Return numbers of joint steps, and the share of episodes in per cent that are solved within each."""
    steps = np.arange(group.reports[0].settings["options"]["max_steps"] + 1)
    shares = []
    for report in group.reports:
        ends = np.array([episode.steps if episode.success else np.inf for episode in report.episodes])
        shares.append(100 * (ends[None, :] <= steps[:, None]).mean(axis=1))
    return steps, np.mean(shares, axis=0)


def _svg(figure: "Drawing") -> str:
    buffer = io.StringIO()
    metadata: dict[str, Any] = {"Date": None, "Creator": None, "Format": None, "Type": None}
    figure.savefig(buffer, format="svg", bbox_inches="tight", metadata=metadata)
    text = buffer.getvalue()
    return text[text.index("<svg") :]
