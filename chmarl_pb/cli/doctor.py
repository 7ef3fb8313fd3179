"""``chmarl-pb doctor``: what is installed, what is kept on disk, and whether this machine gives the known results."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from chmarl_pb.cli.arguments import OutputFile
from chmarl_pb.compiled import COMPILES, kernels
from chmarl_pb.files import cache_folder
from chmarl_pb.progress import progress_bar

_MB = 2**20


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=_run)
    parser.add_argument(
        "--against", type=Path, metavar="JSON", help="compare with these digests (default: those of this package)"
    )
    parser.add_argument(
        "--record", type=OutputFile(".json"), metavar="JSON", help="write the digests of this machine here"
    )


def _run(options: argparse.Namespace) -> int:
    from chmarl_pb.evaluation import golden  # here: it starts PyBullet
    from chmarl_pb.evaluation.provenance import machine, versions

    known = golden.recorded(options.against or golden.RECORDED)
    print("\n".join(_lines_of(versions(), machine(), known)))
    found = dict[str, str]()
    with progress_bar() as bar:
        row = bar.add_task("self-test", total=len(golden.ROLLOUTS))
        for name, value in golden.digests():
            found[name] = value
            bar.advance(row)
    if options.record:
        golden.record(options.record, found)
    different = [name for name, value in found.items() if known["digests"].get(name) != value]
    for name, value in found.items():
        print(f"{'DIFFERS' if name in different else 'equal  '}  {value[:16]}  {name}")
    if different:
        print(
            f"{len(different)} of {len(found)} rollouts differ from those of {_named(known['machine'])}: equal seeds "
            "give other results there. Name versions and processor beside your figures, and compare only what "
            "machines played that agree (--record there, --against here)."
        )
    return 1 if different else 0


def _lines_of(versions: dict[str, str], machine: dict[str, Any], known: dict[str, dict[str, Any]]) -> Iterator[str]:
    """Yield what this machine has, and what the recorded digests were made with where that differs."""
    yield from (f"{name:12} {_beside(value, known['versions'].get(name))}" for name, value in versions.items())
    yield from (f"{name:12} {_beside(value, known['machine'].get(name))}" for name, value in machine.items())
    folder = cache_folder()
    size = sum(_size(file) for file in folder.rglob("*") if file.is_file()) / _MB if folder else 0.0
    yield f"{'cache':12} {f'{folder}, {size:,.1f} MB (chmarl-pb cache)' if folder else 'off: views are drawn anew'}"
    yield f"{'machine code':12} {_compiled()}"


def _size(file: Path) -> int:
    """Return the bytes that a file takes; stored views have room for many that are not drawn yet."""
    status = file.stat()
    return min(status.st_size, 512 * getattr(status, "st_blocks", status.st_size))


def _beside(here: object, there: object) -> str:
    return f"{here}" if there in (here, None) else f"{here} (the digests: {there})"


def _compiled() -> str:
    if not COMPILES:
        return "off (NUMBA_DISABLE_JIT): slow, with the same results"
    count = {folder: len(files) for folder, files in kernels().items()}
    where = ", ".join(f"{number} functions in {folder}" for folder, number in count.items() if number)
    return where or "none yet: the first process compiles for some 15 s"


def _named(machine: dict[str, Any]) -> str:
    return f"{machine.get('processor', 'an unknown processor')}, {machine.get('platform', 'unknown platform')}"
