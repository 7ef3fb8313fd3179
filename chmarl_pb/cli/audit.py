"""The command `chmarl-pb audit`: how much of the score needs neither eyes nor words nor the partner."""

import argparse
from functools import partial
from pathlib import Path

from rich.progress import Progress, TaskID

from chmarl_pb.cli.arguments import (
    SEEDS,
    STDOUT,
    OutputFile,
    add_played,
    add_rules,
    chosen_executor,
    chosen_seeds,
    given_rules,
)
from chmarl_pb.cli.output import add_json, check_json_apart, tell
from chmarl_pb.envs.tracks import split_or_headline
from chmarl_pb.evaluation.as_text import interval, number, percent
from chmarl_pb.evaluation.audit import audit
from chmarl_pb.evaluation.audit_file import FORMAT, Audit, Line
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.progress import progress_bar


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=run_audit)
    add_rules(parser)
    add_played(parser)
    parser.add_argument("--task", action="append", metavar="ID", help="play this task only; may be repeated")
    add_json(parser, lambda found: isinstance(found, dict) and found.get("format") == FORMAT, STDOUT)
    parser.add_argument(
        "--out", type=OutputFile(".json"), metavar="JSON",
        help="write the audit here, and the results of its rows beside it (default: out/audit/TRACK-SPLIT.json, "
        "with what else is given in the name)",
    )  # fmt: skip


def run_audit(options: argparse.Namespace) -> int:
    """Play the shortcut policies, print their table and write it to a file; return the exit code.

    Rows that are there already and were made with the same settings are kept.

    Raises:
        OptionError: there is no such split, a number is less than 1, or something else lies where a file is to be
            written.
        TaskError: there is no such task.
    """
    split = split_or_headline(options.split, options.track)
    out = options.out or Path("out/audit") / f"{'-'.join([options.track, split, *_differing(options)])}.json"
    check_json_apart(options, out.with_suffix(""))
    with chosen_executor(options) as executor, progress_bar() as bar:
        found = audit(
            split, seeds=chosen_seeds(options), executor=executor, out=out, progress=partial(_advance, bar, {}),
            observation=options.observation or "scene_graph", tasks=options.task, **given_rules(options),
        )  # fmt: skip
    tell(
        options, lambda: found.facts,
        lambda: print("\n".join([*table_of(found), "", _best(found), str(out)])),
    )  # fmt: skip
    return 0


def _differing(options: argparse.Namespace) -> list[str]:
    """Return what tells an audit apart from that of the track: what is observed, rules, seeds and tasks, if given."""
    rules = {name: value for name, value in given_rules(options).items() if name != "track"}
    rules |= {"observation": options.observation} if options.observation else {}
    rules |= {"seeds": options.seeds} if options.seeds != SEEDS else {}
    tasks = [f"tasks={sha256_of([' '.join(options.task).encode()])[:8]}"] if options.task else []
    return [f"{name}={value}" for name, value in rules.items()] + tasks


def _advance(bar: Progress, tasks: dict[str, TaskID], row: str, finished: int, total: int) -> None:
    if row not in tasks:
        tasks[row] = bar.add_task(row, total=total)
    bar.update(tasks[row], completed=finished, total=total)


def table_of(found: Audit) -> list[str]:
    """Return the table of an audit as lines of Markdown."""
    head = ("policy", "uses", "success %", "95 % interval", "PLW %", "95 % interval", "steps if solved")
    return [f"| {' | '.join(head)} |", f"|---|---|{'--:|' * (len(head) - 2)}", *map(_row, found.lines)]


def _row(line: Line) -> str:
    rates = (line.success_rate, line.plw)
    known = [text for rate in rates for text in (percent(rate), interval(rate) if rate.low is not None else "")]
    return f"| {' | '.join([line.name, ', '.join(line.uses), *known, number(line.steps)])} |"


def _best(found: Audit) -> str:
    """Return the score that a learner's is to be measured by."""
    settings, best = found.settings, found.best_blind
    where = f"{settings['split']}, {settings['track']} track, {settings['observation']}"
    return f"{where}: best of those that do not see: {best.name}, PLW {percent(best.plw)}; scores are gains over that"
