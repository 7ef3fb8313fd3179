"""The drawing of the dials: PLW with its 95 % intervals."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from matplotlib.figure import Figure as Drawing
from matplotlib.lines import Line2D

if TYPE_CHECKING:
    from benchmarks.dials import Point

#: Okabe and Ito's colours, which the colour-blind tell apart; one a policy, beside a marker of its own.
_POLICIES = (("#0072B2", "o"), ("#D55E00", "s"), ("#009E73", "^"), ("#CC79A7", "D"), ("#E69F00", "v"), ("#56B4E9", "P"))
_ROW, _SERIES = 0.2, 0.09  # inches: height of a setting of messages, and of each series in it
_LABELS, _PANEL = 2.0, 2.6  # inches: width of the settings' names, and of a panel


def draw(points: Sequence["Point"], file: Path) -> None:
    """Draw PLW: a row of panels for each track, a panel for each feedback, a series for each policy.

    Policies that do not read feedback stand in the panels without it. Where nothing reads any, the tracks stand side by
    side.
    """
    tracks, advice, policies = (
        list(dict.fromkeys(getattr(point, key) for point in points)) for key in ("track", "feedback", "policy")
    )
    styles = dict(zip(policies, _POLICIES, strict=False))
    grid = [[(track, feedback) for feedback in advice] for track in tracks]
    grid = grid if len(advice) > 1 else [[panel for line in grid for panel in line]]
    names = list(dict.fromkeys(point.messages for point in points))
    high, wide = (_ROW + _SERIES * len(policies)) * len(names) + 0.9, _LABELS + _PANEL * len(grid[0])
    figure = Drawing(figsize=(wide, high * len(grid) + 0.3), layout="constrained", dpi=100)
    panels = figure.subplots(len(grid), len(grid[0]), squeeze=False, sharex=True, sharey=True)
    for line, of_line in zip(grid, panels, strict=True):
        for (track, feedback), axes in zip(line, of_line, strict=True):
            here = [point for point in points if (point.track, point.feedback) == (track, feedback)]
            axes.set_visible(bool(here))
            _panel(axes, here, names, styles)
            axes.set_title(f"track: {track}\nfeedback: {feedback}", fontsize=9, loc="left")
        of_line[0].set_ylabel("messages")
    shown = [Line2D([], [], color=color, marker=marker, label=name) for name, (color, marker) in styles.items()]
    figure.legend(handles=shown, loc="outside upper center", ncols=len(shown), frameon=False, fontsize=10)
    file.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(file)


def _panel(axes: Any, points: Sequence["Point"], rows: list[str], styles: dict[str, tuple[str, str]]) -> None:
    """Draw the points of one track and one feedback."""
    for shift, (policy, (color, marker)) in enumerate(styles.items()):
        own = [point for point in points if point.policy == policy and point.plw.mean is not None]
        places = [rows.index(point.messages) + 0.6 * ((shift + 0.5) / len(styles) - 0.5) for point in own]
        means = [100 * (point.plw.mean or 0) for point in own]
        low = [mean - 100 * (point.plw.low or 0) for mean, point in zip(means, own, strict=True)]
        high = [100 * (point.plw.high or 0) - mean for mean, point in zip(means, own, strict=True)]
        axes.errorbar(means, places, xerr=[low, high], fmt=marker, color=color, markersize=4, capsize=2)
    axes.set(yticks=range(len(rows)), yticklabels=rows, ylim=(len(rows) - 0.5, -0.5), xlim=(0, 100), xlabel="PLW, %")
    axes.tick_params(labelbottom=True)  # also above panels that are empty
    axes.grid(axis="x", color="#e6e6e6")
    axes.spines[["top", "right"]].set_visible(False)
