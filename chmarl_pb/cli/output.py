"""What commands print: results for people or as JSON, and beside them notes, which ``--quiet`` leaves out."""

import argparse
import errno
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, NoReturn

from rich.console import Console

from chmarl_pb.cli.arguments import STDOUT, OutputFile
from chmarl_pb.errors import WriteError
from chmarl_pb.files import write_atomically
from chmarl_pb.progress import is_silent


class Screen(Console):
    """The standard output; where nobody reads it any more, that is an error, as it is for ``print``."""

    def on_broken_pipe(self) -> NoReturn:
        """Leave it to the program how the command ends.

        Raises:
            BrokenPipeError: always.
        """
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


def add_json(parser: argparse.ArgumentParser, value: str | None = None) -> None:
    """Add the option that writes the result as JSON; with a ``value`` it may stand without one, and means that."""
    parser.add_argument(
        "--json", type=_target, metavar="FILE", nargs="?" if value else None, const=value,
        help="write the result as JSON, too; - prints it in place of all else, as with --quiet",
    )  # fmt: skip


def _target(text: str) -> str:
    return text if text == STDOUT else str(OutputFile(".json")(text))


def tell(options: argparse.Namespace, result: Callable[[], Any], show: Callable[[], object]) -> None:
    """Write a result as JSON if that is asked for, and show it to people.

    The file comes first, for the output may be closed or full; where it cannot be written, the result is shown yet.

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
    failed = None if options.json is None else _failure(Path(options.json), result())
    try:
        show()
    finally:
        if failed is not None:
            raise failed
    if options.json is not None:
        say(options.json)


def _failure(path: Path, result: Any) -> WriteError | None:
    """Write a result; return why it could not be written."""
    try:
        write_atomically(path, json.dumps(result, indent=1, ensure_ascii=False) + "\n")
    except WriteError as error:
        return error
    return None


def say(note: object) -> None:
    """Print a note: where something lies, or what can be done next."""
    if not is_silent():
        print(note)
