"""``chmarl-pb cache``: show, clear or fill what is kept on disk: pictures, generated homes, trials of homes."""

import argparse
import os
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from rich.table import Column, Table

from chmarl_pb.cli.arguments import WORKERS, add_workers, check_used, chosen_executor
from chmarl_pb.cli.output import Screen
from chmarl_pb.errors import OptionError
from chmarl_pb.executors import Executor, Local
from chmarl_pb.files import cache_folder, replaced_name
from chmarl_pb.homes.generate.store import kept_files
from chmarl_pb.progress import progress_bar
from chmarl_pb.rendering.view_store import Entry, ViewStore, view_store

_MB = 2**20
_SIZE = 128  # pixels
_TRIAL = re.compile(r"[0-9a-f]{64}\.json")


def _trials(folder: Path) -> Iterator[Path]:
    """Yield the trials of homes that were kept in a folder."""
    return (file for file in folder.glob("*") if _TRIAL.fullmatch(replaced_name(file)))


@dataclass(frozen=True)
class _Part:
    """A folder of the cache beside the views.

    Attributes:
        name: of the folder.
        what: is kept there.
        ending: of the files that are counted.
        files: yields the files in the folder that the package has written.
    """

    name: str
    what: str
    ending: str
    files: Callable[[Path], Iterable[Path]]


_OTHERS = (_Part("homes", "generated homes", ".urdf", kept_files), _Part("trials", "trials of homes", ".json", _trials))


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
    """Print what is stored and where, or remove all that the package has written there; return 0.

    Links in the place of a folder are removed themselves, and nothing that they lead to.

    Raises:
        OptionError: the cache's place is no folder; or, when the rest is done, that of a part is none, or a file
            cannot be removed.
    """
    folder = cache_folder()
    if folder is None:
        print("nothing is stored on disk")
        return 0
    if blocking := next((path for path in (folder, *folder.parents) if path.exists() and not path.is_dir()), None):
        raise OptionError(f"{blocking} is no folder, so nothing is stored there; let CHMARL_CACHE name a folder")
    wrong = [problem for part in _OTHERS for problem in _run_other(folder / part.name, part, clear)]
    if (store := view_store()) is not None:
        wrong += _run_views(store, clear)
    if wrong:
        raise OptionError(f"{wrong[0]}{f' (and {len(wrong) - 1} more)' if len(wrong) > 1 else ''}")
    return 0


def _run_other(folder: Path, part: _Part, clear: bool) -> list[str]:
    """Print what is kept in a folder, or remove it; return what is wrong."""
    if (wrong := _not_there(folder, clear)) is not None:
        return wrong
    sizes = {file: _size(file) for file in part.files(folder) if file.is_symlink() or not file.is_dir()}
    if clear:
        wrong = _remove(sizes)
        sizes = {file: size for file, size in sizes.items() if not os.path.lexists(file)}
        for emptied in sorted({folder, *(above for file in sizes for above in _within(file, folder))}, reverse=True):
            with suppress(OSError):  # it holds files of others, or is not there
                emptied.rmdir()
    if wrong and not sizes:
        return wrong
    count, size = sum(file.suffix == part.ending for file in sizes), sum(sizes.values()) / _MB
    print(f"{folder}: {'removed ' if clear else ''}{count:,} {part.what}, {size:,.1f} MB")
    if clear and not wrong and (other := next((file for file in folder.rglob("*") if not file.is_dir()), None)):
        print(f"{other}: is not of the cache, and is left as it is")
    return wrong or []


def _run_views(store: ViewStore, clear: bool) -> list[str]:
    """Print which views are stored, or remove them; return what is wrong."""
    if (wrong := _not_there(store.folder, clear)) is not None:
        return wrong
    entries = store.entries()
    if clear:
        wrong = _remove([entry.path for entry in entries])
        entries = [entry for entry in entries if not os.path.lexists(entry.path)]
    size = sum(entry.bytes for entry in entries) / _MB
    if clear:
        print(f"{store.folder}: removed {len(entries)} files, {size:,.1f} MB")
        return wrong or []
    if entries:
        _print_table(entries)
    print(f"{store.folder}: {len(entries)} files, {size:,.1f} MB of {store.limit / _MB:,.0f} MB")
    return []


def _not_there(folder: Path, clear: bool) -> list[str] | None:
    """Return what is wrong where something else is in the place of a folder, None if nothing is.

    A link is removed where all is to be cleared.
    """
    if clear and folder.is_symlink():
        wrong = _remove([folder])
        print(f"{folder}: {'' if wrong else 'removed '}a link; what it leads to is left as it is")
        return wrong
    if folder.exists() and not folder.is_dir():
        return [f"{folder} is no folder, so nothing is kept there; move it away"]
    return None


def _remove(files: Iterable[Path]) -> list[str]:
    """Remove files, links themselves and not what they lead to; return what is wrong."""
    wrong = []
    for file in files:
        try:
            file.unlink(missing_ok=True)
        except OSError as error:
            wrong.append(f"{file}: cannot be removed ({error.strerror}); move it away, or make its folder writable")
    return wrong


def _size(file: Path) -> int:
    """Return the size of a file; none if another process has just removed it."""
    with suppress(OSError):
        return file.lstat().st_size
    return 0


def _within(file: Path, folder: Path) -> list[Path]:
    """Return the folders between a file and the folder that it lies in."""
    return [above for above in file.parents if folder in above.parents]


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
