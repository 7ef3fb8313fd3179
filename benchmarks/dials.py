"""How scores depend on messages, feedback and the track: ``python -m benchmarks.dials --policy search``.

Every point is an evaluation of a policy with one setting of messages and one of feedback, in a track whose other rules
stay: all pairs for policies that read feedback, as learners do, and messages alone for those that do not. A point is
kept, so that a run that was stopped goes on, and ``--messages`` and ``--feedback`` choose single ones. The figures are
written to a folder, a file for each policy and track; the table and the drawing are of all that this folder holds, so
without ``--policy`` they are made anew from it.
"""

import argparse
import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from textwrap import shorten
from typing import Any

from benchmarks.dials_drawing import draw
from chmarl_pb.errors import ChmarlError
from chmarl_pb.evaluation.as_text import interval, percent
from chmarl_pb.evaluation.metrics import Figure
from chmarl_pb.evaluation.protocol import SEEDS, evaluate
from chmarl_pb.evaluation.sample import evaluated_tasks
from chmarl_pb.files import write_atomically
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.progress import LateProgress, progress_bar
from chmarl_pb.tasks.symbols import Symbols
from chmarl_pb.tasks.unreliable import NoisyBoard, UnreliableAdviser

ROOT = Path(__file__).parents[1]
POINTS = ROOT / "results" / "dials"

#: Track -> the split that it is played on, and that every how many of its tasks are taken.
SAMPLES = {"paper": ("val-unseen", 1), "grounded": ("generated-val", 5)}

#: Name of a setting -> the option of the environment.
MESSAGES: dict[str, Any] = {
    "board": True,
    **{f"board, {flips:.0%} misread": NoisyBoard(flips) for flips in (0.1, 0.3)},
    "none": False,
    "own words": Symbols(),
    "own words, 3 steps late": Symbols(delay=3),
    "own words, 60% lost": Symbols(loss=0.6),
    "own words, 30% wrong": Symbols(flips=0.3),
}
FEEDBACK: dict[str, Any] = {
    "none": False,
    "paper": "paper",
    "planner": "planner",
    "planner, 50% lost": UnreliableAdviser("planner", loss=0.5),
    "planner, 50% wrong": UnreliableAdviser("planner", wrong=0.5),
}


@dataclass(frozen=True)
class Point:
    """One measured point.

    Attributes:
        policy: its name.
        track: "paper" or "grounded".
        messages: one of ``MESSAGES``.
        feedback: one of ``FEEDBACK``.
        episodes: their number.
        success: rate, with its 95 % interval.
        plw: path-length weighted success, likewise.
    """

    policy: str
    track: str
    messages: str
    feedback: str
    episodes: int
    success: Figure
    plw: Figure

    @property
    def place(self) -> tuple[int, int]:
        """Where its settings stand in their lists."""
        return list(MESSAGES).index(self.messages), list(FEEDBACK).index(self.feedback)


def pairs_of(source: str, messages: Sequence[str], feedback: Sequence[str]) -> list[tuple[str, str]]:
    """Return the settings that a policy is played with; what does not read feedback gets none."""
    reads = source not in BUILT_IN or "feedback" in BUILT_IN[source].uses
    return [(words, advice) for words in messages for advice in (feedback if reads else ["none"])]


def measure(name: str, source: str, track: str, options: argparse.Namespace, bar: LateProgress) -> Iterator[Point]:
    """Yield the points of a policy; where it cannot play, as learners that say nothing with own words, there is none.

    Args:
        name: of the policy, in table and drawing.
        source: the policy, see ``evaluate``.
        track: one of ``SAMPLES``.
        options: of the command.
        bar: shows the episodes.
    """
    split, every = SAMPLES[track]
    tasks = evaluated_tasks(split)[:: every * options.thin]
    for messages, feedback in pairs_of(source, options.messages or [*MESSAGES], options.feedback or [*FEEDBACK]):
        file = options.out / f"{_slug(name)}-{track}-{_slug(messages)}-{_slug(feedback)}.json"
        try:
            report = evaluate(
                source, split, seeds=range(options.seeds), workers=options.workers, tasks=tasks, out=file, reuse=True,
                progress=bar.counter(f"{name}, {track}, messages: {messages}, feedback: {feedback}"),
                label=name, track=track, messages=MESSAGES[messages], feedback=FEEDBACK[feedback],
            )  # fmt: skip
        except ChmarlError as error:
            bar.console.print(f"{name}, {track}, messages: {messages}: left out, as {shorten(str(error), 200)}")
            continue
        figures = report.summary
        yield Point(name, track, messages, feedback, figures.episodes, figures.success_rate, figures.plw)


def _slug(text: str) -> str:
    return "".join(letter if letter.isalnum() else "-" for letter in text)


def load_points(folder: Path) -> list[Point]:
    """Return the points that a folder holds, in the order of their settings."""
    points = [
        Point(**{**entry, "success": Figure(**entry["success"]), "plw": Figure(**entry["plw"])})
        for file in sorted(folder.glob("*.json"))
        for entry in json.loads(file.read_text(encoding="utf-8"))
    ]
    return sorted(points, key=lambda point: (list(SAMPLES).index(point.track), point.place))


def keep_point(folder: Path, point: Point) -> None:
    """Write a point into its file, in the place of an older one with the same settings."""
    file = folder / f"{point.track}-{_slug(point.policy)}.json"
    kept = load_points(folder) if file.is_file() else []
    same = [other for other in kept if (other.policy, other.track) == (point.policy, point.track)]
    points = sorted([point, *(other for other in same if other.place != point.place)], key=lambda one: one.place)
    lines = ",\n".join(json.dumps(asdict(one)) for one in points)
    write_atomically(file, f"[\n{lines}\n]\n")


def table(points: Sequence[Point]) -> str:
    """Return success and PLW as Markdown: one table for each track, and one for each policy that reads feedback."""
    parts = []
    for track in dict.fromkeys(point.track for point in points):
        here = [point for point in points if point.track == track]
        parts.append(_table(f"{track}: messages", [one for one in here if one.feedback == "none"], "policy"))
        for policy in sorted({point.policy for point in here if point.feedback != "none"}):
            own = [point for point in here if point.policy == policy]
            parts.append(_table(f"{track}, {policy}: messages; feedback:", own, "feedback"))
    return "\n\n".join(parts)


def _table(title: str, points: Sequence[Point], heads: str) -> str:
    """Return a table with a row for each setting of messages and a column for each value of an attribute."""
    columns = list(dict.fromkeys(getattr(point, heads) for point in points))
    lines = [f"| {title} | {' | '.join(columns)} |", "|---" + "|--:" * len(columns) + "|"]
    for messages in dict.fromkeys(point.messages for point in points):
        cells = {getattr(one, heads): _cell(one) for one in points if one.messages == messages}
        lines.append(f"| {messages} | {' | '.join(cells.get(column, '') for column in columns)} |")
    return "\n".join(lines)


def _cell(point: Point) -> str:
    return f"{percent(point.success).split(' ')[0]} / {percent(point.plw).split(' ')[0]} [{interval(point.plw)}]"


def _named(text: str) -> tuple[str, str]:
    """Return name and source of NAME=SOURCE; a source alone is its own name."""
    name, equals, source = text.partition("=")
    return (name, source) if equals else (Path(text).stem, text)


def main() -> None:
    """Measure the points that are asked for; print and draw all that are kept."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.dials", description=__doc__)
    parser.add_argument(
        "--policy", action="append", type=_named, default=[], metavar="[NAME=]P",
        help="policy or checkpoint, and its name in table and drawing; may be repeated (default: measure none)",
    )  # fmt: skip
    parser.add_argument("--track", action="append", choices=[*SAMPLES], help="this one (default: both)")
    for dial, settings in (("messages", MESSAGES), ("feedback", FEEDBACK)):
        parser.add_argument(
            f"--{dial}", action="append", choices=[*settings], metavar="SETTING",
            help="this one; may be repeated (default: all): " + "; ".join(settings).replace("%", "%%"),
        )  # fmt: skip
    parser.add_argument("--thin", type=int, default=1, metavar="N", help="play every Nth of the track's tasks only")
    parser.add_argument("--seeds", type=int, default=len(SEEDS))
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--out", type=Path, default=ROOT / "out" / "dials", help="folder for results")
    parser.add_argument("--points", type=Path, default=POINTS, help="folder for the figures (default: results/dials)")
    parser.add_argument("--plot", type=Path, help="file for the drawing")
    options = parser.parse_args()
    if options.thin > 1 and options.policy and options.points == POINTS:
        parser.error("--thin: name another folder by --points; these points would replace those of all tasks")
    with progress_bar() as bar:
        for name, source in options.policy:
            for track in options.track or SAMPLES:
                for point in measure(name, source, track, options, bar):
                    keep_point(options.points, point)
    points = load_points(options.points)
    print(table(points))
    if options.plot and points:
        draw(points, options.plot)


if __name__ == "__main__":
    main()
