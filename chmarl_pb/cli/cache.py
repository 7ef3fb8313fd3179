"""``chmarl-pb cache``: show, clear or fill what is kept on disk: pictures, generated homes, trials of homes."""

import argparse
import shutil
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path

from rich.table import Column, Table

from chmarl_pb.cli.arguments import WORKERS, add_workers, check_used, chosen_executor
from chmarl_pb.cli.output import Screen
from chmarl_pb.errors import OptionError
from chmarl_pb.executors import Executor, Local
from chmarl_pb.files import cache_folder
from chmarl_pb.progress import progress_bar
from chmarl_pb.rendering.view_store import Entry, view_store

_MB = 2**20
_SIZE = 128  # pixels
#: Folder of the cache -> what is in it, and which of its files are counted.
_OTHERS = {"homes": ("generated homes", "*.urdf"), "trials": ("trials of homes", "*.json")}


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=_run)
    what = parser.add_mutually_exclusive_group()
    what.add_argument("--clear", action="store_true", help="remove them all")
    what.add_argument("--fill", nargs="+", metavar="HOME", help="draw all views of these homes, e.g. before a training")
    parser.add_argument(
        "--size", type=int, default=_SIZE, metavar="N", help="pixels of the views to draw (default: %(default)s)"
    )
    add_workers(parser)


def _run(options: argparse.Namespace) -> int:
    if options.fill:
        with chosen_executor(options) as executor:
            return run_fill(options.fill, options.size, executor)
    check_used(options, {"size": _SIZE, "ray": None, "workers": WORKERS}, "is for --fill")
    return run_cache(options.clear)


def run_cache(clear: bool) -> int:
    """Print what is stored and where, or remove it all; return 0.

    Raises:
        OptionError: the cache's place is no folder.
    """
    folder = cache_folder()
    if folder is None:
        print("nothing is stored on disk")
        return 0
    if blocking := next((path for path in (folder, *folder.parents) if path.exists() and not path.is_dir()), None):
        raise OptionError(f"{blocking} is no folder, so nothing is stored there; let CHMARL_CACHE name a folder")
    for name, (what, pattern) in _OTHERS.items():
        _run_other(folder / name, what, pattern, clear)
    store = view_store()
    if store is None:
        return 0
    entries = store.entries()
    size = sum(entry.bytes for entry in entries) / _MB
    if clear:
        store.clear()
        print(f"{store.folder}: removed {len(entries)} files, {size:,.1f} MB")
        return 0
    if entries:
        _print_table(entries)
    print(f"{store.folder}: {len(entries)} files, {size:,.1f} MB of {store.limit / _MB:,.0f} MB")
    return 0


def _run_other(folder: Path, what: str, pattern: str, clear: bool) -> None:
    """Print how many files that fit a pattern are in a folder, and the size of all, or remove it."""
    size = sum(file.stat().st_size for file in folder.rglob("*") if file.is_file()) / _MB
    count = sum(1 for _ in folder.rglob(pattern))
    if clear and folder.exists():
        shutil.rmtree(folder)
    print(f"{folder}: {'removed ' if clear else ''}{count:,} {what}, {size:,.1f} MB")


def run_fill(homes: Sequence[str], size: int, executor: Executor) -> int:
    """Draw all views of homes that the machines of an executor have not stored yet; return 0.

    Args:
        homes: names or paths.
        size: width and height of the pictures.
        executor: who draws; each machine has a store of its own.

    Raises:
        HomeError: a home cannot be read.
        OptionError: the store has no room, or an option is out of range.
    """
    from chmarl_pb.sensing.view_filling import (  # not to show what is stored: it starts PyBullet
        MB,
        Filling,
        draw,
        missing,
    )

    if not 16 <= size <= 1024:
        raise OptionError(f"size={size}: use a size from 16 to 1024")
    filling = Filling(homes, size)
    print(f"{', '.join(homes)}: all views take {filling.bytes / MB:,.1f} MB, {filling.missing:,} are missing")
    elsewhere = not isinstance(executor, Local)
    if jobs := filling.jobs(elsewhere):
        with progress_bar() as bar:
            row = bar.add_task("drawing views", total=None if elsewhere else filling.missing)
            for count in draw(jobs, executor):
                bar.advance(row, count)
    if left := missing(homes, size, executor) if elsewhere else filling.missing:
        raise OptionError(f"{left:,} views found no room in the store; end what uses it, or raise its limit")
    return 0


def _print_table(entries: list[Entry]) -> None:
    table = Table("home, camera, pixels", Column("MB", justify="right"), "last used")
    for entry in reversed(entries):
        used = datetime.fromtimestamp(entry.used).strftime("%Y-%m-%d %H:%M")
        what = entry.path.stem.rpartition("_")[0]
        table.add_row(what, f"{entry.bytes / _MB:,.1f}", used)
    Screen().print(table)
