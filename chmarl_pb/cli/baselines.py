"""The command `chmarl-pb baselines`: the built-in policies on the splits, and the lengths that results stand beside."""

import argparse
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from chmarl_pb.cli.arguments import add_seeds, add_track, add_workers, chosen_executor, chosen_seeds, output_folder
from chmarl_pb.cli.output import add_json, check_json_apart, each, tell
from chmarl_pb.envs.tracks import GROUNDED, MAX_STEPS, PAPER, TRACKS
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.as_text import interval, number, percent
from chmarl_pb.evaluation.cooperation import check_reference, write_reference
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.protocol import check_out, evaluate
from chmarl_pb.evaluation.result import Report, is_summary
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.progress import progress_bar
from chmarl_pb.tasks.language import WORDINGS
from chmarl_pb.tasks.splits import BENCHMARK_SPLITS, GENERATED_HOMES, load_tasks

_SPLITS = {PAPER: BENCHMARK_SPLITS, GROUNDED: tuple(GENERATED_HOMES)}  # track -> its splits
_SCORES = (("success %", "success_rate"), ("PLW %", "plw"))


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=run_baselines)
    parser.add_argument(
        "--split", action="append", metavar="S", help="this split (default: those of the track); may be repeated"
    )
    parser.add_argument(
        "--policy", action="append", choices=list(BUILT_IN), help="this one (default: all); may be repeated"
    )
    add_track(parser)
    add_json(parser, each(each(is_summary)))  # split -> policy -> its summary
    add_seeds(parser)
    add_workers(parser)
    parser.add_argument(
        "--out", type=output_folder, default=Path("out/baselines"), metavar="DIR", help="folder for results"
    )
    parser.add_argument(
        "--references",
        type=output_folder,
        metavar="DIR",
        help="write the lengths of all episodes here, a file a split, beside those of other policies",
    )


def run_baselines(options: argparse.Namespace) -> int:
    """Evaluate the built-in policies, print their tables as Markdown; return the exit code.

    Results that are there already and were made with the same settings are kept.

    Raises:
        TaskError: there is no such split.
        OptionError: a number is less than 1, references are asked for that are not of the paper's rules, or something
            else lies where a file is to be written.
    """
    if options.references is not None and options.track != PAPER:
        raise OptionError(f"--references are lengths by the paper's rules; leave out --track {options.track}")
    splits: Sequence[str] = options.split or _SPLITS[options.track]
    for split in splits:
        load_tasks(split)  # says so if there is no such split
    policies: Sequence[str] = options.policy or tuple(BUILT_IN)
    own = "" if options.track == PAPER else f"{options.track}-"
    files = {(split, policy): options.out / f"{own}{split}-{policy}.json" for split in splits for policy in policies}
    references = {split: options.references / f"{split}.json" for split in splits if options.references is not None}
    check_json_apart(options, options.out, options.references)
    for path in files.values():
        check_out(path)
    for path in references.values():
        check_reference(path)
    reports: dict[str, dict[str, Report]] = {split: {} for split in splits}
    with chosen_executor(options) as executor, progress_bar() as bar:
        for split in splits:
            for policy in policies:
                reports[split][policy] = evaluate(
                    policy, split, seeds=chosen_seeds(options), executor=executor,
                    out=files[split, policy], reuse=True,
                    progress=bar.counter(f"{policy} on {split}"), track=options.track,
                )  # fmt: skip
            if split in references:
                episodes = {name: report.episodes for name, report in reports[split].items()}
                write_reference(references[split], split, MAX_STEPS, episodes)
    tables = [*_tables(reports), _difficulty(reports, TRACKS[options.track]["max_steps"])]
    tell(
        options,
        lambda: {split: {name: one.facts for name, one in row.items()} for split, row in reports.items()},
        lambda: print("\n\n".join(map("\n".join, tables))),
    )
    return 0


def _tables(reports: dict[str, dict[str, Report]]) -> list[list[str]]:
    """Return one Markdown table for each metric: rows are policies, columns splits."""
    cells: dict[str, Callable[[Report], str]] = {
        "success %": lambda report: percent(report.summary.success_rate),
        "PLW %": lambda report: percent(report.summary.plw),
        "PLW %, 95 % interval": lambda report: interval(report.summary.plw),
        "steps if solved": lambda report: number(report.summary.length_on_success),
        **{
            f"{title}, {name} wording": partial(_of_wording, metric, name)
            for title, metric in _SCORES
            for name in WORDINGS
        },
    }
    played = next(iter(reports.values()))
    return [
        [
            f"| {metric} | {' | '.join(reports)} |",
            "|---" * (len(reports) + 1) + "|",
            *(f"| {policy} | {' | '.join(cell(reports[split][policy]) for split in reports)} |" for policy in played),
        ]
        for metric, cell in cells.items()
    ]


def _of_wording(metric: str, wording: str, report: Report) -> str:
    summary = report.per_wording.get(wording)
    return percent(getattr(summary, metric)) if summary else "-"


def _difficulty(reports: dict[str, dict[str, Report]], most: int) -> list[str]:
    """Return a Markdown table of the success in per cent that random and search reach within fewer steps."""
    cuts = range(10, most + 1, 5)
    rows = [f"| success % within | {' | '.join(map(str, cuts))} |", "|---" * (len(cuts) + 1) + "|"]
    for split, of in reports.items():
        for policy in (name for name in of if name in ("random", "search")):
            shares = [f"{100 * success_within(of[policy].episodes, cut):.1f}" for cut in cuts]
            rows.append(f"| {policy}, {split} | {' | '.join(shares)} |")
    return rows


def success_within(episodes: Sequence[Played], steps: int) -> float:
    """Return the share of episodes that succeed within a number of joint steps, as with that ``max_steps``."""
    return sum(episode.success and episode.steps <= steps for episode in episodes) / len(episodes)
