"""Learning curves of the runs of a table, as a picture beside the page of results."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.envs.tracks import TRACKS
from chmarl_pb.files import replacing
from training.tables.record import Record
from training.tables.row import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_COLOURS = {"bc": "#54a24b", "iql": "#b279a2", "vdn": "#f58518", "qmix": "#4c78a8", "qtran": "#e45756"}
_COLOURS |= {"pqn": "#5e3c99", "mappo": "#7fb800", "qr-dqn": "#c49c94"}
_COLOURS |= {"ppo": "#17a2b8", "a2c": "#a8a21c", "dqn": "#8c564b", "recurrent-ppo": "#e377c2"}
_CENTRALIZED, _OTHER = "#1b6b3a", "#6b6b6b"
_VARIANTS = (", longer", ", grounded")  # of the paper's rows
_SB3 = "training.sb3"  # rows of Stable-Baselines3
#: Whether the humanoid learns alone, whether the goal is observed -> style of the line.
_SB3_STYLES = {(False, False): "-", (True, False): ":", (False, True): "--", (True, True): "-."}
#: Rows that share an algorithm with others and differ in what they learn from, by name.
_OURS = {
    "Imitation of belief, generated homes": "#d00000", "Imitation of belief, generated homes, longer": "#d00000",
    "Imitation of belief, generated homes, words parsed": "#0050c8", "Imitation of belief, words parsed": "#0050c8",
    "Imitation of belief": "#000000",
    "Imitation of belief, then MAPPO": "#d4a017", "Imitation of search, then MAPPO": _OTHER,
    "Imitation of search": "#a65628", "Imitation of planner": "#9ecae1",
    "Imitation of belief, generated homes, memory": "#ff4fa3",
    "Imitation of belief, generated homes, words parsed, memory": "#00b0ff",
    "Imitation of belief, generated homes, words parsed, looks": "#7b61ff",
    "Imitation of belief, generated homes, words parsed, history": "#2e8b57",
    "Imitation of belief, generated homes, words parsed, greedy rollouts": "#ff8c00",
    "Imitation of belief, generated homes, ResNet-18": "#ff9da7",
    "QMIX + messages, grounded": "#00897b", "QMIX + messages, grounded, generated homes": "#00897b",
    "QMIX, grounded": "#00897b",
}  # fmt: skip
#: Colours of the table of messages and feedback, by observation and feedback.
_APART = {
    ("scene_graph", True): "#4c78a8", ("scene_graph", False): "#72b7b2",
    ("visual", True): "#e45756", ("visual", False): "#f58518",
}  # fmt: skip
#: Of all pictures of the page.
STYLE: Any = {
    "font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "axes.grid": True, "axes.axisbelow": True,
    "grid.color": "#e6e6e6", "savefig.dpi": 110, "axes.titlesize": 10, "axes.titlelocation": "left",
}  # fmt: skip
_WIDTH = 5  # points of a running mean
_PANEL, _LEGEND_LINE, _LEGEND_LETTER, _LEGEND_MARK = 3.7, 0.2, 0.063, 0.6  # inches

#: Panels: title, unit of x, curve.
_PANELS = (
    ("Success in training, with exploration (%)", "episodes", "success"),
    ("PLW on validation tasks (%)", "episodes", "validation"),
    ("PLW on validation tasks (%)", "epochs", "validation"),
    ("PLW on validation tasks (%)", "steps", "validation"),
)


def draw_curves(
    table: str, rows: Sequence[Row], records: dict[tuple[str, str], list[Record]], folder: Path
) -> list[str]:
    """Draw the curves of a table; return the Markdown that shows them, nothing without runs or without matplotlib.

    Args:
        table: its name.
        rows: of the table.
        records: (table, row) -> runs.
        folder: of the page.
    """
    try:
        import matplotlib
        from matplotlib.figure import Figure
    except ImportError:
        return []
    known = [(row, records[row.table, row.slug]) for row in rows if (row.table, row.slug) in records]
    panels = [panel for panel in _PANELS if any(_curves(same, *panel[1:]) for _, same in known)]
    if not panels:
        return []
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(_PANEL * len(panels), 3.2), layout="constrained")
        for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            _draw(axes, table == "feedback", known, *panel)
        _add_legend(figure)
        path = folder / f"curves_{table.replace('-', '_')}.png"
        with replacing(path) as temporary:
            figure.savefig(temporary, format="png", metadata={"Software": None})
    dashed = "pictures" if table in TRACKS else "without messages; dots and dashes: our variants of the paper's rows"
    if table not in TRACKS and any(row.module == _SB3 for row, _ in known):
        dashed += "; Stable-Baselines3: dots, the humanoid alone; dashes, the goal observed; dots and dashes, both"
    text = (
        f"Lines are means over seeds, bands go from the lowest to the highest seed; dashed: {dashed}. The curve of a "
        "learner that began as another (ours: imitation) starts after the other's episodes."
    )
    if any(panel[2] == "success" for panel in panels):
        text += f" Success in training is a running mean of {_WIDTH} points."
    return [f"![Learning curves]({path.name})", text]


def _curves(same: Sequence[Record], unit: str, name: str) -> list[NDArray[np.float64]]:
    """Return the curve of each run, (points, 2), as far as they have one.

    That of a learner which began with another's weights starts after the other's budget.
    """
    return [
        np.array(record["curve"][name], dtype=float) + np.array([_before(record, unit), 0])
        for record in same
        if record["curve"]["unit"] == unit and record["curve"][name]
    ]


def side_by_side(curves: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return curves, (points, 2) each, at common places: these, (n,), and all values there, (curves, n).

    The places are those of all curves as far as all of them go; in between values are interpolated.
    """
    places = np.unique(np.concatenate([curve[:, 0] for curve in curves]))
    first, last = (pick([curve[end, 0] for curve in curves]) for pick, end in ((max, 0), (min, -1)))
    places = places[(places >= first) & (places <= last)]
    return places, np.stack([np.interp(places, curve[:, 0], curve[:, 1]) for curve in curves])


def _before(record: Record, unit: str) -> int:
    return int(record["checkpoint"].get("begun_with", {}).get("config", {}).get(unit, 0))


def _add_legend(figure: "Figure") -> None:
    """Name every line once, at the right of all panels, which keep their width."""
    lines = {str(line.get_label()): line for axes in figure.axes for line in axes.get_lines()}
    figure.set_figwidth(figure.get_figwidth() + _LEGEND_MARK + _LEGEND_LETTER * max(map(len, lines)))
    figure.set_figheight(max(figure.get_figheight(), _LEGEND_LINE * (len(lines) + 1)))
    figure.legend(list(lines.values()), list(lines), loc="outside right center", frameon=False, fontsize=8)


def _draw(
    axes: "Axes", apart: bool, known: Sequence[tuple[Row, list[Record]]], title: str, unit: str, name: str
) -> None:
    for row, same in known:
        curves = _curves(same, unit, name)
        if not curves:
            continue
        if name == "success":
            curves = [np.stack([curve[:, 0], _smooth(curve[:, 1])], axis=1) for curve in curves]
        x, y = side_by_side(curves)
        y *= 100
        colour = _APART[row.observation, row.feedback] if apart else _colour(row)
        axes.plot(x, y.mean(axis=0), color=colour, linestyle=_style(row, apart), label=_label(row, apart))
        axes.fill_between(x, y.min(axis=0), y.max(axis=0), color=colour, alpha=0.1, linewidth=0)
    from matplotlib.ticker import MaxNLocator

    axes.set_title(title)
    axes.set_xlabel(unit)
    axes.set_ylim(bottom=0)
    axes.set_xlim(left=0)
    axes.xaxis.set_major_locator(MaxNLocator(5, integer=True))


def _colour(row: Row) -> str:
    if "--centralized" in row.options:
        return _CENTRALIZED
    if row.name in _OURS:
        return _OURS[row.name]
    return _COLOURS.get(row.options[1], _OTHER) if row.options[:1] == ("--algo",) else _OTHER


def _style(row: Row, apart: bool) -> str:
    """Return how a row's line is drawn: our variants of the paper's rows have its colours; apart, ours have QMIX's."""
    if row.table in TRACKS:  # a table of both observations, whose rows all have messages
        return "-" if row.observation == "scene_graph" else "--"
    if row.module == _SB3:
        return _SB3_STYLES["humanoid only" in row.name, "goal observed" in row.name]
    if row.name.endswith(_VARIANTS):
        return "-." if row.messages else ":"
    if apart and row.name in _OURS:
        return "-."
    return "-" if row.messages else "--"


def _label(row: Row, apart: bool) -> str:
    """Return a row's name; what tells rows apart in the table of messages and feedback, and in those of tracks."""
    if apart:
        return row.setting
    seen = "graphs" if row.observation == "scene_graph" else "pictures"
    return f"{seen}: {row.name}" if row.table in TRACKS else row.name


def _smooth(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a running mean that is shorter at both ends."""
    window = np.ones(min(_WIDTH, len(values)))
    return np.convolve(values, window, "same") / np.convolve(np.ones(len(values)), window, "same")
