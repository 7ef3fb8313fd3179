"""What commands print: results for people or as JSON, and beside them notes, which ``--quiet`` leaves out."""

import argparse
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from chmarl_pb.cli.arguments import STDOUT, OutputFile
from chmarl_pb.files import write_atomically
from chmarl_pb.progress import is_silent


def add_json(parser: argparse.ArgumentParser, value: str | None = None) -> None:
    """Add the option that writes the result as JSON; with a ``value`` it may stand without one, and means that."""
    parser.add_argument(
        "--json", type=_target, metavar="FILE", nargs="?" if value else None, const=value,
        help="write the result as JSON, too; - prints it in place of all else, as with --quiet",
    )  # fmt: skip


def _target(text: str) -> str:
    return text if text == STDOUT else str(OutputFile(".json")(text))


def tell(options: argparse.Namespace, result: Callable[[], Any], show: Callable[[], object]) -> None:
    """Show a result to people, and write it as JSON if that is asked for.

    Args:
        options: with ``json``.
        result: returns it as plain data.
        show: prints it.

    Raises:
        WriteError: the file cannot be written.
    """
    if options.json == STDOUT:
        print(json.dumps(result(), indent=1, ensure_ascii=False))
        return
    show()
    if options.json is not None:
        write_atomically(Path(options.json), json.dumps(result(), indent=1, ensure_ascii=False) + "\n")
        say(options.json)


def say(note: object) -> None:
    """Print a note: where something lies, or what can be done next."""
    if not is_silent():
        print(note)
