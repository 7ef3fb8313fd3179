"""How scores depend on messages, feedback and the track: ``python -m benchmarks.dials --policy search``.

From the own setting of a track one dial at a time is turned: what carries messages, or what feedback there is. Every
point is an evaluation of a policy on all tasks of a split; it is kept, so that a run that was stopped goes on, and
``--only`` measures a single one. The table is printed, the figures are written to a JSON file and drawn with their 95 %
intervals.
"""

import argparse
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from rich.progress import Progress

from chmarl_pb.cli.evaluate import interval, percent, progress_bar
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.protocol import SEEDS, evaluate
from chmarl_pb.files import write_atomically
from chmarl_pb.policies.sources import name_of
from chmarl_pb.tasks.symbols import Symbols
from chmarl_pb.tasks.unreliable import NoisyBoard, UnreliableAdviser

ROOT = Path(__file__).parents[1]
TRACKS = ("paper", "grounded")
POLICIES = ("blind", "instruction-blind", "search", "belief")

#: Name of a point -> the option that it sets; the dial is the option's name.
MESSAGES: dict[str, Any] = {
    "the board": True,
    "silence": False,
    **{f"the board, {flips:.0%} misread": NoisyBoard(flips) for flips in (0.05, 0.1, 0.2, 0.3)},
    "own words": Symbols(),
    **{f"own words, {delay} steps late": Symbols(delay=delay) for delay in (3, 6)},
    **{f"own words, {loss:.0%} lost": Symbols(loss=loss) for loss in (0.3, 0.6)},
    "own words, 30% wrong": Symbols(flips=0.3),
}
FEEDBACK: dict[str, Any] = {
    "none": False,
    "paper": "paper",
    "planner": "planner",
    "planner, 50% lost": UnreliableAdviser("planner", loss=0.5),
    "planner, 50% wrong": UnreliableAdviser("planner", wrong=0.5),
    "planner, 3 steps late": UnreliableAdviser("planner", delay=3),
}
DIALS = {"messages": MESSAGES, "feedback": FEEDBACK}


@dataclass(frozen=True)
class Point:
    """One measured point.

    Attributes:
        policy: its name.
        track: "paper" or "grounded".
        dial: "messages" or "feedback".
        name: where the dial stands.
        success: rate, with its interval over tasks.
        plw: path-length weighted success, likewise.
    """

    policy: str
    track: str
    dial: str
    name: str
    success: Figure
    plw: Figure


def measure(policy: str, track: str, dial: str, name: str, options: argparse.Namespace, bar: Progress) -> Point | None:
    """Return a point, or None if the policy cannot play there, as learners that say nothing with own words."""
    row = bar.add_task(f"{name_of(policy)}, {track}, {dial}: {name}", total=None)
    file = options.out / f"{options.split}-{track}-{dial}-{_slug(name)}-{_slug(Path(policy).stem)}.json"
    try:
        report = evaluate(
            policy, options.split, seeds=range(options.seeds), workers=options.workers, out=file, reuse=True,
            progress=lambda finished, total: bar.update(row, completed=finished, total=total),
            track=track, **{dial: DIALS[dial][name]},
        )  # fmt: skip
    except OptionError as error:
        bar.console.print(f"{policy}, {name}: left out, as {error}")
        return None
    return Point(Path(policy).stem, track, dial, name, report.summary.success_rate, report.summary.plw)


def _slug(text: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in text)


def table(points: Sequence[Point]) -> str:
    """Return the points as Markdown: a table for each track and dial, a column for each policy."""
    parts = []
    for track, dial in dict.fromkeys((point.track, point.dial) for point in points):
        here = [point for point in points if (point.track, point.dial) == (track, dial)]
        policies = list(dict.fromkeys(point.policy for point in here))
        lines = [f"| {track}: {dial} | {' | '.join(policies)} |", "|---" * (len(policies) + 1) + "|"]
        for name in dict.fromkeys(point.name for point in here):
            cells = {point.policy: _cell(point) for point in here if point.name == name}
            lines.append(f"| {name} | {' | '.join(cells.get(policy, '-') for policy in policies)} |")
        parts.append("\n".join(lines))
    return "\n\n".join(parts)


def _cell(point: Point) -> str:
    return f"{percent(point.success).split(' ')[0]} / {percent(point.plw).split(' ')[0]} [{interval(point.plw)}]"


def draw(points: Sequence[Point], file: Path) -> None:
    """Draw PLW with its intervals, a panel for each track and dial."""
    from matplotlib.figure import Figure as Drawing

    panels = list(dict.fromkeys((point.track, point.dial) for point in points))
    figure = Drawing(figsize=(5.5 * len(panels), 4.6), layout="constrained", dpi=110)
    for axes, panel in zip(figure.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
        here = [point for point in points if (point.track, point.dial) == panel]
        names, policies = (list(dict.fromkeys(getattr(point, key) for point in here)) for key in ("name", "policy"))
        for shift, policy in enumerate(policies):
            own = [point for point in here if point.policy == policy and point.plw.mean is not None]
            rows = [names.index(point.name) + 0.7 * ((shift + 0.5) / len(policies) - 0.5) for point in own]
            means = [100 * (point.plw.mean or 0) for point in own]
            low = [mean - 100 * (point.plw.low or 0) for mean, point in zip(means, own, strict=True)]
            high = [100 * (point.plw.high or 0) - mean for mean, point in zip(means, own, strict=True)]
            axes.errorbar(means, rows, xerr=[low, high], fmt="o", markersize=4, capsize=2, label=policy)
        axes.set(
            yticks=range(len(names)), yticklabels=names, xlim=(0, 100), xlabel="PLW, %", title=" track: ".join(panel)
        )
        axes.invert_yaxis()
        axes.grid(axis="x", color="#e6e6e6")
        axes.legend(frameon=False, fontsize=8)
    figure.savefig(file)


def main() -> None:
    """Measure the points that are asked for, print and draw them."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.dials", description=__doc__)
    parser.add_argument("--policy", action="append", help=f"name or checkpoint (default: {', '.join(POLICIES)})")
    parser.add_argument("--split", default="val-unseen")
    parser.add_argument("--track", action="append", choices=TRACKS, help="this one (default: both)")
    parser.add_argument("--dial", action="append", choices=list(DIALS), help="this one (default: both)")
    parser.add_argument("--only", action="append", metavar="NAME", help="this point of a dial; may be repeated")
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "dials", help="folder for results")
    parser.add_argument("--json", type=Path, help="file for the figures")
    parser.add_argument("--plot", type=Path, help="file for the drawing")
    options = parser.parse_args()
    with progress_bar() as bar:
        found = [
            measure(policy, track, dial, name, options, bar)
            for track in options.track or TRACKS
            for dial in options.dial or DIALS
            for name in DIALS[dial] if not options.only or name in options.only
            for policy in options.policy or POLICIES
        ]  # fmt: skip
    points = [point for point in found if point is not None]
    print(table(points))
    if options.json:
        write_atomically(options.json, json.dumps({"split": options.split, "points": [*map(asdict, points)]}, indent=1))
    if options.plot:
        draw(points, options.plot)


if __name__ == "__main__":
    main()
