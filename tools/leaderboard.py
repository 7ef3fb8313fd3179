"""The leaderboard: ``python -m tools.leaderboard`` writes docs/leaderboard.md from the files in results/.

Files of ``results/leaderboard`` are results that ``chmarl-pb evaluate --out`` has written; those of the tables of the
learners are ``results/TABLE/ROW-seedK.json``. ``--check FILE ...`` says whether a result can be sent, and plays its
actions again.
"""

import argparse
import json
import sys
from collections import defaultdict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from statistics import fmean
from typing import Any

from chmarl_pb.envs.options import OBSERVATIONS, Options
from chmarl_pb.envs.tracks import GROUNDED, HEADLINE_SPLITS, PAPER, TRACKS
from chmarl_pb.errors import ChmarlError, ResultError
from chmarl_pb.evaluation.as_text import points
from chmarl_pb.evaluation.gain import gain, gain_of
from chmarl_pb.evaluation.json_file import read_object
from chmarl_pb.evaluation.played_again import what_differs
from chmarl_pb.evaluation.protocol import SEEDS
from chmarl_pb.evaluation.provenance import home_hashes, tasks_hash
from chmarl_pb.evaluation.result import SEATS_APART, Report, load_result
from chmarl_pb.evaluation.tables import label_of
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.tasks.splits import load_tasks
from tools.leaderboard_labels import Sender, is_not_free, other_owner
from training.tables.cells import ALONE, run_is_told_more

ROOT = Path(__file__).parents[1]
PAGE, SENT = ROOT / "docs" / "leaderboard.md", ROOT / "results" / "leaderboard"
TABLES = {"scene-graph": PAPER, "visual": PAPER, "grounded": GROUNDED}  # -> their track
BEGIN, END = "<!-- leaderboard -->", "<!-- end of leaderboard -->"
HEAD = "| | policy | observation | is given | runs | success % | PLW % | gain |\n|--:|---|---|---|--:|--:|--:|--:|"


@dataclass(frozen=True)
class Entry:
    """One training, or one policy that does not learn, on the test split of a track.

    Attributes:
        track: "paper" or "grounded".
        name: of the policy.
        observation: what it observes.
        given: what it lacks of the track's rules, and what it is given beyond its own observation; may be empty.
        success: share of the tasks, 0 to 1.
        plw: 0 to 1.
        gain: over the best blind policy, points; None where no audit is of these rules.
    """

    track: str
    name: str
    observation: str
    given: str
    success: float
    plw: float
    gain: float | None

    @property
    def row(self) -> tuple[str, ...]:
        """What the trainings of one row have in common."""
        return self.track, self.name, self.observation, self.given


@dataclass(frozen=True)
class Sent:
    """A result that was sent, and its entry."""

    path: Path
    report: Report
    entry: Entry

    @property
    def sender(self) -> Sender:
        """What the file tells of whose it is."""
        entry = self.entry
        row = entry.track, entry.observation, entry.given
        return Sender(self.path, entry.name, self.report.settings["policy"], row)


def sent(path: Path) -> Entry:
    """Return the entry of a result file.

    Raises:
        ResultError: it is damaged, not of all tasks of a track's test split by that track's rules, or has the name of
            one of our rows or policies.
    """
    return _sent(path).entry


def _sent(path: Path) -> Sent:
    report = load_result(path)
    if "sha256" not in read_object(path):  # which results had not when there was no leaderboard
        raise ResultError(f"{path}: it has no sha256 of what it holds; evaluate again with this version")
    if fault := _fault(report):
        raise ResultError(f"{path}: {fault}")
    if reason := is_not_free(report, {entry.name for entry in trained()}):
        raise ResultError(f"{path}: {reason}; give another by --label")
    return Sent(path, report, _entry(report))


def _entry(report: Report) -> Entry:
    given = [*(f"no {name}" for name in report.without), *filter(None, [report.declared])]
    given += ["goal"] if report.settings["options"].get("goal") else []
    observation = str(report.settings["observation"])
    gained = gain_of(report)
    return Entry(
        report.track, label_of(report), observation, ", ".join(given), report.success_rate, report.plw,
        gained.mean if gained else None,
    )  # fmt: skip


def _fault(report: Report) -> str:
    """Return why a result is none of the leaderboard; empty if it is one."""
    settings, track = report.settings, report.track
    split = HEADLINE_SPLITS[track]
    if settings["split"] != split:
        return f"it is of {settings['split']}; play {split}"
    if settings["tasks_sha256"] != tasks_hash(load_tasks(split)):
        return f"it is not of all tasks of {split}; leave out --task and --home"
    if report.changed:
        return f"its rules are not the track's ({report.changed}); leave out the options that change them"
    if settings["options"]["max_steps"] != TRACKS[track]["max_steps"]:
        return f"it has {settings['options']['max_steps']} steps; leave out --max-steps"
    if settings["observation"] not in OBSERVATIONS:
        return f"it observes {settings['observation']}; the tracks' observations are {' and '.join(OBSERVATIONS)}"
    if (pixels := settings["options"].get("image_size", Options.image_size)) != Options.image_size:
        return f"its pictures have {pixels} pixels; leave out --image-size"
    seeds = settings["seeds"]
    known = BUILT_IN.get(settings["policy"])
    once = report.run.get("deterministic") or (known is not None and known.deterministic)
    if seeds == [0] and not once and "deterministic" not in report.run:
        return "it does not say whether its policy draws its actions; evaluate again with this version"
    if seeds != list(range(max(len(seeds), 1 if once else len(SEEDS)))):
        return f"it has the seeds {seeds}; leave out --seeds: a policy that draws its actions plays {len(SEEDS)}"
    if settings["homes_sha256"] != home_hashes(load_tasks(split)):
        return "its homes are of another version; evaluate again with this one"
    return ""


@cache
def trained() -> tuple[Entry, ...]:
    """Return the entries of the learners' tables."""
    files = [(path, track) for table, track in TABLES.items() for path in (ROOT / "results" / table).glob("*.json")]
    return tuple(_of_training(json.loads(path.read_text(encoding="utf-8")), track) for path, track in sorted(files))


def _of_training(run: dict[str, Any], track: str) -> Entry:
    split, options = HEADLINE_SPLITS[track], run["evaluation"]["options"]
    summary = run["evaluation"]["splits"][split]["summary"]
    success, plw = summary["success_rate"]["mean"], summary["plw"]["mean"]
    given = [f"no {name}" for name in ("messages", "feedback") if TRACKS[track][name] and not run[name]]
    given += ["goal"] if options.get("goal") else []
    if run["observation"] == "visual" and ALONE in run["name"]:
        given.append("the drone is told what is in view")
    gained = None if run_is_told_more(run) else gain([plw], split, track)  # who is told more gains nothing by seeing
    return Entry(track, run["name"], run["observation"], ", ".join(given), success, plw, gained)


def tables(entries: Iterable[Entry]) -> str:
    """Return a table for each track that has entries, the best PLW first; trainings of one row are averaged."""
    rows: defaultdict[tuple[str, ...], list[Entry]] = defaultdict(list)
    for entry in entries:
        rows[entry.row].append(entry)
    best_first = sorted(rows.values(), key=lambda row: (-_mean(row), row[0].row))
    of_track = {track: [row for row in best_first if row[0].track == track] for track in TRACKS}
    return "\n\n".join(
        f"## The {track} track, {HEADLINE_SPLITS[track]}\n\n{HEAD}\n{_lines(own)}"
        for track, own in of_track.items()
        if own
    )


def _mean(row: Sequence[Entry]) -> float:
    return fmean(entry.plw for entry in row)


def _lines(rows: Iterable[Sequence[Entry]]) -> str:
    return "\n".join(f"| {place} | {_cells(row)} |" for place, row in enumerate(rows, 1))


def _cells(row: Sequence[Entry]) -> str:
    gains = [entry.gain for entry in row if entry.gain is not None]
    numbers = [f"{100 * fmean(entry.success for entry in row):.1f}", f"{100 * _mean(row):.1f}"]
    first = row[0]
    cells = [first.name, first.observation.replace("_", " "), first.given, str(len(row)), *numbers]
    return " | ".join([*cells, points(fmean(gains) if gains else None)])


def entries() -> list[Entry]:
    """Return all entries.

    Raises:
        ResultError: a result cannot be one, or is there twice.
    """
    before = list[Sent]()
    for path in sorted(SENT.glob("*.json")):
        before.append(_checked(path, before))
    return [*trained(), *(one.entry for one in before)]


def _checked(path: Path, others: Sequence[Sent]) -> Sent:
    """Return a result that its actions come to, and that is neither a copy nor under the label of another policy."""
    one = _sent(path)
    if differs := what_differs(one.report):
        raise ResultError(f"{path}: {differs}; evaluate again")
    for other in others:
        if _is_copy(one.report, other.report):
            raise ResultError(f"{path}: the same episodes as {other.path}; a copy is no second training")
    if owner := other_owner(one.sender, [other.sender for other in others]):
        raise ResultError(
            f"{path}: its label {one.entry.name!r} is that of {owner.path}, of {owner.policy}; give another by "
            "--label, or let names of policies and files differ in numbers alone, if both are trainings of one policy"
        )
    return one


def _is_copy(one: Report, other: Report) -> bool:
    """Return whether two results are one; built-in policies may do the same whatever they observe."""
    played = [[(*episode.job, episode.actions) for episode in report.episodes] for report in (one, other)]
    built_in = all(report.settings["policy"] in BUILT_IN for report in (one, other))
    observed = one.settings["observation"] == other.settings["observation"]
    return played[0] == played[1] and one.without == other.without and (observed or not built_in)


def _check(files: Sequence[Path]) -> None:
    """Say of files whether they can be sent, beside those that were and would not be replaced."""
    names = {path.name for path in files}
    others = [_sent(path) for path in sorted(SENT.glob("*.json")) if path.name not in names]
    for path in files:
        others.append(_checked(path, others))
        entry = others[-1].entry
        given = f", is given: {entry.given}" if entry.given else ""
        scores = f"PLW {entry.plw:.1%}, success {entry.success:.1%}"
        seats = _of_seats(others[-1].report)
        print(f"{path}: {entry.name}, {entry.track} track, {scores}{given}; its actions come to this{seats}")


def _of_seats(report: Report) -> str:
    """Return what a result says of whether seats share what they observe; nothing where they cannot."""
    if report.settings["policy"] in BUILT_IN or report.declared:
        return ""
    if SEATS_APART in report.run:
        return f"; it says that its seats share nothing in {report.run[SEATS_APART]} episodes"
    return "; it does not say whether its seats share what they observe: evaluate with --check-seats"


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the page, or check files."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", nargs="+", type=Path, metavar="FILE", help="say whether results can be sent")
    files = parser.parse_args(arguments).check
    try:
        if files:
            _check(files)
            return 0
        before, rest = PAGE.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        PAGE.write_text(f"{before}{BEGIN}\n\n{tables(entries())}\n\n{END}{after}", encoding="utf-8")
        print(PAGE)
        return 0
    except ChmarlError as error:
        print(error, file=sys.stderr)
        return 1


if __name__ == "__main__":
    sys.exit(main())
