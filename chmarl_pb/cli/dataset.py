"""The commands ``chmarl-pb dataset generate | verify | stats``."""

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any

from rich.table import Column, Table

from chmarl_pb.cli.arguments import (
    add_catalog,
    add_home,
    add_robots,
    add_verb,
    add_workers,
    check_used,
    chosen_executor,
    output_folder,
    verbs,
)
from chmarl_pb.cli.output import Screen, add_json, each, has, say, tell
from chmarl_pb.data import statistics
from chmarl_pb.data.generate import generate
from chmarl_pb.data.read import Dataset, find_datasets
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.data.store import default_root
from chmarl_pb.data.verify import chosen, verify
from chmarl_pb.envs.options import OBSERVATIONS
from chmarl_pb.errors import DatasetError
from chmarl_pb.progress import progress_bar
from chmarl_pb.tasks.splits import BENCHMARK_SPLITS, STREAM, load_tasks


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to a parser."""
    all_verbs = verbs(parser)
    making = add_verb(
        all_verbs,
        "generate",
        "let the planner play all tasks and store it as Minari data sets",
        "chmarl-pb dataset generate --split val-unseen --out out/data",
    )
    making.set_defaults(run=generate_datasets)
    making.add_argument(
        "--observation", choices=(*OBSERVATIONS, "both"), default="scene_graph",
        help="what is stored (default: %(default)s)",
    )  # fmt: skip
    making.add_argument("--noise", type=float, default=0.0, metavar="EPS", help="share of random actions (default 0)")
    making.add_argument(
        "--seed", type=int, default=0, metavar="N", help="seed of the random actions, and of drawn tasks (default: 0)"
    )
    making.add_argument("--limit", type=int, metavar="N", help="play only the first N tasks of each split")
    add_robots(making)
    add_home(making, "tasks are drawn for it, --limit or 100")
    add_catalog(making)
    verifying = add_verb(
        all_verbs,
        "verify",
        "check the files of data sets and replay their episodes",
        "chmarl-pb dataset verify --share 0.1 --out out/data",
    )
    verifying.set_defaults(run=verify_datasets)
    verifying.add_argument("--share", type=float, default=1.0, metavar="F", help="share of episodes (default: 1)")
    for verb in (making, verifying):
        verb.add_argument("--split", action="append", metavar="S", help="only this split; may be repeated")
        add_workers(verb)
    stats = add_verb(
        all_verbs,
        "stats",
        "print statistics of tasks, data sets and language",
        "chmarl-pb dataset stats --json stats.json",
    )
    stats.set_defaults(run=print_statistics)
    add_json(stats, has("tasks", "datasets", "language"))
    add_json(verifying, each(has("replayed", "episodes")))
    for verb in (making, verifying, stats):
        verb.add_argument(
            "--out", type=output_folder, metavar="DIR", help="folder of data sets (default: Minari's own)"
        )


def generate_datasets(options: argparse.Namespace) -> int:
    """Make data sets; return 0, or 1 if the planner alone left a task unsolved.

    Raises:
        AssetError: there is no such robot.
        OptionError: an option has a value that it does not know.
        DatasetError: another data set of this name is in the folder.
    """
    root = options.out or default_root()
    if options.home is not None:
        check_used(options, {"split": None}, "is not played where --home is")
    chosen = options.split or (BENCHMARK_SPLITS if options.home is None else ("train",))
    if not options.noise and options.home is None and STREAM not in chosen:
        check_used(options, {"seed": 0}, "is for --noise, and for tasks that are drawn (--home, --split generated)")
    modes = OBSERVATIONS if options.observation == "both" else (options.observation,)
    recipes = [
        Recipe(split, mode, options.noise, options.seed, options.limit, options.robots, options.home, options.catalog)
        for mode in modes
        for split in chosen
    ]
    made = []
    with chosen_executor(options) as executor:
        for recipe in recipes:
            with _bar(recipe.dataset_id, len(recipe.tasks)) as progress:
                made.append(generate(recipe, root, progress=progress, executor=executor))
    facts = [statistics.dataset_statistics(dataset) for dataset in made]
    _print_datasets(facts)
    say(f"In {root}: set MINARI_DATASETS_PATH={root}, then minari.load_dataset({made[0].dataset_id!r}).")
    unsolved = [] if options.noise else [row["id"] for row in facts if row["success_rate"] < 1]
    for dataset_id in unsolved:
        print(f"chmarl-pb: {dataset_id}: the planner left tasks unsolved", file=sys.stderr)
    return 1 if unsolved else 0


def verify_datasets(options: argparse.Namespace) -> int:
    """Verify the data sets in a folder; return 0.

    Raises:
        TaskError: there is no such split.
        DatasetError: there is none, or one is damaged or differs from its replay.
    """
    for split in options.split or ():
        load_tasks(split)  # says so if there is no such split
    root = options.out or default_root()
    replayed: dict[str, dict[str, int]] = {}
    with chosen_executor(options) as executor:
        for dataset in _chosen_datasets(root, options.split):
            with _bar(dataset.dataset_id, len(chosen(dataset.episodes, options.share))) as progress:
                count = verify(dataset, options.share, progress=progress, executor=executor)
            replayed[dataset.dataset_id] = {"replayed": count, "episodes": dataset.episodes}
    tell(options, lambda: replayed, partial(_print_replayed, replayed))
    return 0


def _chosen_datasets(root: Path, splits: Sequence[str] | None) -> list[Dataset]:
    found = [dataset for dataset in find_datasets(root) if not splits or dataset.recipe["split"] in splits]
    if not found:
        raise DatasetError(f"{root}: no data set to verify; make one by `chmarl-pb dataset generate --out {root}`")
    return found


def _print_replayed(replayed: dict[str, dict[str, int]]) -> None:
    for name, row in replayed.items():
        print(f"{name}: {row['replayed']} of {row['episodes']} episodes replayed, all equal")


def print_statistics(options: argparse.Namespace) -> int:
    """Print statistics of the tasks, of the data sets in a folder and of their language; return 0."""
    datasets = find_datasets(options.out or default_root())
    every = {split: load_tasks(split) for split in BENCHMARK_SPLITS}
    facts: dict[str, Any] = {
        "tasks": {split: statistics.task_statistics(tasks) for split, tasks in every.items()},
        "datasets": [statistics.dataset_statistics(dataset) for dataset in datasets],
        "language": statistics.language_statistics(datasets),
    }
    tell(options, lambda: facts, partial(_print_statistics, facts))
    return 0


def _print_statistics(facts: dict[str, Any]) -> None:
    _print_tasks(facts["tasks"])
    if facts["datasets"]:
        _print_datasets(facts["datasets"])
    _print_language(facts["language"], len(facts["datasets"]))


@contextmanager
def _bar(title: str, total: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar; yield the function that moves it on."""
    with progress_bar() as bar:
        row = bar.add_task(title, total=total)
        yield lambda count: bar.advance(row, count)


def _print_tasks(splits: dict[str, statistics.Facts]) -> None:
    table = Table("split", *(_column(name) for name in ("tasks", "homes", "objects", "sources", "targets", "mean L*")))
    for split, row in splits.items():
        numbers = [len(row[name]) for name in ("homes", "graspables", "sources", "targets")]
        table.add_row(split, f"{row['tasks']:,}", *map(str, numbers), f"{row['mean_optimal_steps']:.2f}")
    _print(table)
    lengths = statistics.added(row["optimal_steps"] for row in splits.values())
    _print_histogram("L*", lengths)


def _print_datasets(rows: Sequence[statistics.Facts]) -> None:
    names = ("episodes", "steps", "solved", "off the plan", "feedback", "size")
    table = Table("data set", *(_column(name) for name in names))
    for row in rows:
        table.add_row(
            row["id"], f"{row['episodes']:,}", f"{row['steps']:,}", f"{row['success_rate']:.1%}",
            f"{row['steps_off_the_plan']:,}", f"{row['feedback_sentences']:,}", f"{row['bytes'] / 1e6:.1f} MB",
        )  # fmt: skip
    _print(table)


def _print_language(facts: statistics.Facts, datasets: int) -> None:
    print(
        f"language: {facts['sentences']:,} sentences (instructions of all tasks, feedback in {datasets} data sets), "
        f"{facts['distinct_words']} distinct words, mean length {facts['mean_length']:.2f} words"
    )
    _print_histogram("words", {str(length): count for length, count in facts["histogram"].items()})


def _print_histogram(title: str, counts: dict[str, int]) -> None:
    table = Table(_column(title), _column("number"), "")
    most = max(counts.values(), default=1)
    for value, count in counts.items():
        table.add_row(value, f"{count:,}", "█" * round(40 * count / most))
    _print(table)


def _column(name: str) -> Column:
    return Column(name, justify="right")


def _print(table: Table) -> None:
    Screen(width=None if sys.stdout.isatty() else 110).print(table)
