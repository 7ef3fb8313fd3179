"""``chmarl-pb evaluate``: a progress bar, a table, a result file."""

import argparse
import shlex
import sys
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.table import Table

from chmarl_pb.cli.arguments import (
    GOAL,
    STDOUT,
    OutputFile,
    add_catalog,
    add_home,
    add_played,
    add_robots,
    add_rules,
    check_home,
    check_used,
    chosen_executor,
    chosen_seeds,
    given_of,
    given_rules,
)
from chmarl_pb.cli.output import Screen, add_json, say, tell
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import HEADLINE_SPLITS, OF_TRACK, PAPER, split_or_headline
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.as_text import interval, interval_text, number, percent, points
from chmarl_pb.evaluation.cooperation import reference_scores
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.gain import gain_of
from chmarl_pb.evaluation.intervals import are_drawn
from chmarl_pb.evaluation.metrics import Summary
from chmarl_pb.evaluation.protocol import evaluate
from chmarl_pb.evaluation.result import Report, is_summary
from chmarl_pb.evaluation.rules import rules_with
from chmarl_pb.evaluation.tables import notes_of, where_of
from chmarl_pb.limits import whole_number
from chmarl_pb.policies.registry import BUILT_IN, SEARCHES, SHORTCUTS
from chmarl_pb.policies.sources import Source, find_policy
from chmarl_pb.progress import is_silent, progress_bar
from chmarl_pb.robots.registry import TEAM, listed

_MOST_HOMES = 20  # that are shown one by one
_DRAWN = 20  # tasks for a home


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=run_evaluation)
    parser.add_argument(
        "--policy",
        required=True,
        metavar="P",
        help=f"{', '.join(BUILT_IN)}, published weights, module:callable, or a checkpoint's path",
    )
    add_rules(parser, OF_TRACK, "that of the checkpoint, whose rules hold where no option says otherwise; else paper")
    add_played(parser)
    parser.add_argument("--goal", action="store_true", help=GOAL)
    add_robots(parser)
    add_home(parser, "--draw tasks are drawn for it, the same every time")
    parser.add_argument("--draw", type=int, metavar="N", help=f"tasks for --home (default: {_DRAWN})")
    add_catalog(parser)
    parser.add_argument(
        "--env", metavar="M:C", help="module:callable that takes parallel_env's options and returns it in wrappers"
    )
    add_json(parser, is_summary)
    parser.add_argument("--label", metavar="NAME", help="row of the report (default: the policy)")
    parser.add_argument(
        "--check-seats", action="store_true",
        help="first look, in some episodes, whether the robots' policies share what they observe; the result says so",
    )  # fmt: skip
    parser.add_argument("--task", action="append", metavar="ID", help="play this task only; may be repeated")
    parser.add_argument(
        "--out",
        type=OutputFile(".json"),
        metavar="JSON",
        help="write the result here; the same command goes on when interrupted",
    )


def run_evaluation(options: argparse.Namespace) -> int:
    """Evaluate a policy, print its metrics, and write them to a file if one is given; see ``evaluate``."""
    check_home(options)
    _refuse_idle(options)
    source = find_policy(options.policy)
    rules = rules_with(source.rules, given_rules(options) | given_of(options))
    tasks, track = options.task, rules.get("track", PAPER)
    where = split_or_headline(options.split, track)
    if options.home is not None:
        count = _DRAWN if options.draw is None else whole_number("draw", options.draw, 1)
        drawn = {"catalog": options.catalog, "robots": options.robots, "track": track}
        tasks = draw_tasks(options.home, count, lookalikes=rules.get("lookalikes", OF_TRACK), **drawn)
        where = options.home
    with chosen_executor(options) as executor, progress_bar() as bar:
        row = bar.add_task(f"{options.policy} on {where}", total=None)

        def advance(finished: int, total: int) -> None:
            if bar.tasks[row].total is None and finished and not is_silent():
                print(f"going on: {finished} of {total} episodes are there already", file=sys.stderr)
            bar.update(row, completed=finished, total=total)

        report = evaluate(
            options.policy, options.split, options.observation, chosen_seeds(options), executor=executor,
            tasks=tasks, out=options.out, label=options.label, env_fn=options.env, **rules,
            progress=advance, check_seats=options.check_seats,
        )  # fmt: skip
    beside = "" if options.home is not None or options.task else _published(source, report)
    tell(options, lambda: report.facts, partial(_show, report, beside))
    if options.out is not None and options.json != STDOUT:
        say(options.out)
    return 0


def _refuse_idle(options: argparse.Namespace) -> None:
    """Refuse options that would change nothing.

    Raises:
        OptionError: one of them is given.
    """
    if options.home is not None:
        check_used(options, {"split": OF_TRACK}, "is not played where --home is")
    else:
        check_used(options, {"draw": None}, "is the number of tasks for --home")
    if options.label is not None and options.out is None and options.json is None:
        raise OptionError(
            f"label={options.label!r} names a row of reports, and no file is written; give --out, or leave out --label"
        )


def _show(report: Report, beside: str) -> None:
    """Print a result, and what is published of it."""
    print_report(Screen(), report)
    if beside:
        print(beside)


def _published(source: Source, report: Report) -> str:
    """Return what is published of a policy for what it has played, by the same rules; nothing if that is not known."""
    weights, split = source.weights, report.settings["split"]
    figures = weights.published.get(split) if weights else None
    if weights is None or figures is None or "env" in report.settings:
        return ""
    rules = Options(weights.observation, split, **weights.rules).recorded()
    played = {**report.settings["options"], "split": split, "observation": report.settings["observation"]}
    if played != rules:
        return ""
    return f"published: {100 * figures['success_rate']:.1f} / {100 * figures['plw']:.1f} (success / PLW on {split})"


def print_report(console: Console, report: Report) -> None:
    """Print the metrics of a result, for all homes and, if they are not too many, for each."""
    settings = report.settings
    where = where_of(report)
    notes = [note for note in notes_of(report) if note != f"in {where}"]
    title = ", ".join((f"{settings['policy']} on {where}", settings["observation"], *notes))
    columns = ("", "episodes", "success %", "PLW %", "steps if solved", "potential")
    table = Table(title=title, title_justify="left")
    for column in columns:
        table.add_column(column, justify="right" if column else "left")
    for home, summary in report.per_home.items() if len(report.per_home) <= _MOST_HOMES else ():
        table.add_row(home, *_cells(summary))
    table.add_section()
    for wording, summary in report.per_wording.items() if len(report.per_wording) > 1 else ():
        table.add_row(f"{wording} words", *_cells(summary))
    table.add_row("all", *_cells(report.summary), style="bold")
    console.print(table)
    _print_notes(console, report)


def _cells(summary: Summary) -> list[str]:
    return [
        str(summary.episodes),
        percent(summary.success_rate),
        percent(summary.plw),
        number(summary.length_on_success),
        number(summary.final_potential),
    ]


def _print_notes(console: Console, report: Report) -> None:
    seeds, summary = report.settings["seeds"], report.summary
    if summary.plw.low is not None:
        drawn = "homes" if are_drawn(list(report.per_home)) else "tasks"
        console.print(
            f"95 % interval over {drawn}: success {interval(summary.success_rate)}, PLW {interval(summary.plw)}"
            + (f"; ± over {len(seeds)} seeds" * (len(seeds) > 1))
        )
    if shares := report.recognition.figures():
        words = {
            "pick_share": "picks in {:.0%} of the steps with X in view",
            "place_share": "places in {:.0%} of those with Y in view and X held",
        }
        console.print(", ".join(words[name].format(share) for name, share in shares.items()))
    if report.bounded:
        console.print(f"L* is an upper bound in {report.bounded} of {summary.episodes} episodes, so PLW is one, too")
    if beside := _beside(report):
        console.print(f"on the same tasks, success / PLW: {beside}")
    if gained := gain_of(report):
        between = f", 95 % interval over the same tasks: {text}" if (text := interval_text(gained)) else ""
        console.print(f"gain over the best blind policy: {points(gained.mean)} points of PLW{between}")
    gain = report.cooperation
    if gain is None:
        console.print("cooperation: no reference lengths for these tasks, this max_steps and this environment")
        return
    share = "-" if gain.share is None else f"{100 * gain.share:.0f} %"
    pair = "-" if gain.share_pair is None else f"{100 * gain.share_pair:.0f} %"
    console.print(
        f"cooperation: {share} of the possible gain in PLW over the lone humanoid (belief pair: {pair}); "
        f"{gain.steps_saved:.1f} of {gain.steps_possible:.1f} steps saved a task"
    )


def _beside(report: Report) -> str:
    """Return what the policies score that do without most of what a robot is given, and those that search with all."""
    if report.changed:
        return ""
    tasks = {episode.task for episode in report.episodes}
    scores = reference_scores(report.settings["split"], report.settings["options"]["max_steps"], tasks)
    names = [name for name in (*SHORTCUTS, *SEARCHES) if name in scores]
    return ", ".join(f"{name} {100 * scores[name].success_rate:.1f} / {100 * scores[name].plw:.1f}" for name in names)


def evaluate_command(policy: Path, options: Options, robots: str) -> str:
    """Return the command that evaluates trained weights on the test tasks, or in the home that they were trained in.

    Args:
        policy: file of the weights.
        options: of the environment that they were trained in; weights of ``chmarl-pb train`` know its other rules.
        robots: names and files of its robots, with commas between them.
    """
    words = ["chmarl-pb", "evaluate", "--policy", str(policy)]
    words += ["--home", str(options.home)] if options.home else ["--split", HEADLINE_SPLITS[options.track]]
    words += ["--track", options.track] if options.track != PAPER else []
    words += ["--observation", str(options.observation), *(["--goal"] if options.goal else [])]
    words += ["--robots", robots] if listed(robots) != TEAM else []
    words += ["--catalog", str(options.catalog)] if options.catalog else []
    return shlex.join(words)
