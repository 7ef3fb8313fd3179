"""`python -m training.table`: train and evaluate every row of the tables; killed at any moment, it goes on.

Every run is trained and evaluated in processes of its own, and leaves one small file under ``results/``. Runs that
have one are skipped.
"""

import argparse
import fnmatch
import subprocess
import sys
from collections.abc import Iterable, Sequence
from functools import partial
from pathlib import Path

from chmarl_pb.data.recipe import Recipe
from chmarl_pb.errors import ChmarlError, OptionError
from chmarl_pb.executors import Executor, started
from chmarl_pb.learning.runs.interrupts import run_command
from chmarl_pb.progress import progress_bar
from training.tables.page import write_page
from training.tables.row import Row
from training.tables.rows import TABLES
from training.tables.runs import Run, python, read_records
from training.tables.schedule import Schedule, as_step, end, on_ray
from training.tables.sheet import write_sheet

RESULTS, OUT, PAGE = Path("results"), Path("out/tables"), Path("docs/results.md")


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    given = list(sys.argv[1:] if arguments is None else arguments)
    cut = given.index("--") if "--" in given else len(given)
    parser = _parser()
    chosen, extra = parser.parse_args(given[:cut]), tuple(given[cut + 1 :])
    for flag in ("jobs", "seeds"):
        if (value := getattr(chosen, flag)) is not None and value < 1:
            parser.error(f"--{flag} {value}: use at least 1")
    chosen.results = RESULTS if chosen.results.resolve() == RESULTS.resolve() else chosen.results
    if extra and chosen.results == RESULTS:
        parser.error("options after -- make other results: name another folder for them by --results")
    page = PAGE if chosen.results == RESULTS else chosen.results / PAGE.name
    return run_command(partial(_main, chosen, extra, page))


def _main(chosen: argparse.Namespace, extra: tuple[str, ...], page: Path) -> int:
    if chosen.show and not chosen.results.is_dir():
        raise OptionError(f"--results {chosen.results}: no such folder; name the one that has the results")
    failed = [] if chosen.show else _work(chosen, extra, page)
    write_page(chosen.results, page)
    print(page)
    if chosen.csv:
        write_sheet(read_records(chosen.results, TABLES), chosen.csv)
        print(chosen.csv)
    return 1 if failed else 0


def _work(chosen: argparse.Namespace, extra: tuple[str, ...], page: Path) -> list[str]:
    """Do all runs that are not finished; return the names of those that failed."""
    runs = make_runs(chosen, extra)
    if extra:
        check_tries(runs)
    write_page(chosen.results, page)  # what is wrong with it shows now, not after the first run
    launch = as_step if chosen.ray is None else partial(on_ray, chosen.ray)
    schedule = Schedule(runs, chosen.jobs, chosen.budget, lambda run: write_page(chosen.results, page), launch)
    if schedule.waiting:
        with started(chosen.jobs, chosen.ray) as executor:
            schedule.fail(prepare(schedule.waiting, chosen.data, executor))
    schedule.work()
    if schedule.waiting:
        print(f"{len(schedule.waiting)} runs were not started: the time was up", file=sys.stderr)
    return schedule.failed


def make_runs(chosen: argparse.Namespace, extra: tuple[str, ...] = ()) -> list[Run]:
    """Return the chosen runs, each once: first all rows with the first seed, then with the next.

    Raises:
        OptionError: no row has one of the given names.
    """
    rows = list(dict.fromkeys(row for table in chosen.table for row in TABLES[table]))
    out = chosen.out or (OUT if chosen.results == RESULTS else chosen.results / "runs")
    if chosen.only:
        rows = [row for row in rows if any(fnmatch.fnmatch(row.slug, name) for name in _known(chosen.only, rows))]
    seeds = {row: row.seeds if chosen.seeds is None else chosen.seeds for row in rows}
    return [
        Run(row, seed, out, chosen.results, chosen.data, extra)
        for seed in range(max(seeds.values(), default=0))
        for row in rows
        if seed < seeds[row]
    ]


def check_tries(runs: Iterable[Run]) -> None:
    """Refuse kept results of tries with other options: these runs would be skipped, and the page tell of the others.

    Raises:
        OptionError: there is one.
    """
    for run in runs:
        if run.result.is_file() and (made := run.made_by()) != (wanted := run.told("train")):
            raise OptionError(
                f"{run.result}: was made by other options ({made}), and not by these ({wanted}); remove it, or name "
                "another folder by --results"
            )


def _known(names: Sequence[str], rows: Sequence[Row]) -> Sequence[str]:
    slugs = list(dict.fromkeys(row.slug for row in rows))
    for name in names:
        if not fnmatch.filter(slugs, name):
            raise OptionError(f"--rows {name}: no such row; use {', '.join(slugs)}")
    return names


def prepare(runs: Sequence[Run], data: Path, executor: Executor) -> dict[Run, str]:
    """Make what several runs need, if it is missing: weights of encoders, data sets, features of their pictures.

    Returns:
        Those that cannot be trained, as their data set cannot be made or used, or another process makes it -> why.

    Raises:
        ChmarlError: the weights cannot be made or used.
    """
    seeing = [run for run in runs if run.row.observation == "visual" and not _is_trained(run)]
    for name in dict.fromkeys(run.row.image_encoder for run in seeing):
        from chmarl_pb.learning.networks.frozen import weights_file

        if not weights_file(name).is_file():
            if _finished(python(["training.pretrain", "--network", name])) != 0:
                raise ChmarlError(f"training.pretrain has failed, and pictures need its weights of {name}")
    cloned: dict[tuple[str, str, str], list[Run]] = {}
    for run in runs:
        if run.row.clones and not _is_trained(run):
            cloned.setdefault((run.row.data, run.row.observation, run.row.image_encoder), []).append(run)
    failed: dict[Run, str] = {}
    for (split, observation, encoder), needing in cloned.items():
        try:
            _prepare_data(Recipe(split, observation), encoder, data, executor)
        except ChmarlError as error:
            failed |= dict.fromkeys(needing, f"--data {data}: {error}")
    return failed


def _finished(command: list[str]) -> int:
    """Run a command to its end, and return its exit code; an interrupt is passed on, and it may save what it has."""
    process = subprocess.Popen(command, start_new_session=True)
    try:
        return process.wait()
    finally:
        end(process)


def _is_trained(run: Run) -> bool:
    return run.next_step() != "train"


def _prepare_data(recipe: Recipe, image_encoder: str, data: Path, executor: Executor) -> None:
    from chmarl_pb.data.generate import generate

    with progress_bar() as bar:
        line = bar.add_task(recipe.dataset_id, total=len(recipe.tasks))
        dataset = generate(recipe, data, progress=lambda done: bar.advance(line, done), executor=executor)
    if recipe.observation == "visual":  # here, as one run would wait for the other
        from chmarl_pb.learning.networks.frozen import frozen_encoder
        from chmarl_pb.learning.networks.kept_features import kept_features

        kept_features(dataset, frozen_encoder(image_encoder))


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="python -m training.table",
        description="Train and evaluate every row of the tables; killed at any moment, it goes on.",
        epilog="Options after -- go to every training, for tries: python -m training.table --results out/try --seeds 1 "
        "--rows qmix -- --episodes 200",
    )
    parser.add_argument("--table", nargs="+", choices=TABLES, default=list(TABLES), help="default: all")
    parser.add_argument(
        "--rows", "--only", dest="only", nargs="+", metavar="ROW", help="names, e.g. qmix-messages or 'bc-*'"
    )
    parser.add_argument("--seeds", type=int, help="trainings of each row (default: 3, on pictures mostly 2)")
    parser.add_argument("--jobs", type=int, default=2, help="processes side by side (default 2)")
    parser.add_argument("--ray", metavar="ADDRESS", help="do the runs on a Ray cluster, --jobs at a time")
    parser.add_argument("--budget", type=float, metavar="MINUTES", help="start no run after so many minutes")
    parser.add_argument("--show", action="store_true", help="train nothing, write the page")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="write the scores of each seed on each split, too")
    parser.add_argument("--data", type=Path, default=Path("out/data"), help="of data sets (default %(default)s)")
    parser.add_argument("--out", type=Path, help=f"folder for models and logs (default {OUT})")
    parser.add_argument("--results", type=Path, default=RESULTS, help="folder for results (default %(default)s)")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
