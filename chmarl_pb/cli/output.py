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
from chmarl_pb.errors import OptionError, WriteError
from chmarl_pb.evaluation.json_file import check_own
from chmarl_pb.files import write_atomically
from chmarl_pb.progress import is_silent

#: Tells of what a JSON file holds whether a command has written it.
IsOwn = Callable[[Any], bool]


class Screen(Console):
    """The standard output; where nobody reads it any more, that is an error, as it is for ``print``."""

    def on_broken_pipe(self) -> NoReturn:
        """Leave it to the program how the command ends.

        Raises:
            BrokenPipeError: always.
        """
        raise BrokenPipeError(errno.EPIPE, os.strerror(errno.EPIPE))


def add_json(parser: argparse.ArgumentParser, is_own: IsOwn, value: str | None = None) -> None:
    """Add the option that writes the result as JSON; with a ``value`` it may stand without one, and means that.

    Args:
        parser: of the command.
        is_own: tells which files the command may write anew.
        value: what the option means without one.
    """
    parser.add_argument(
        "--json", type=_target, metavar="FILE", nargs="?" if value else None, const=value,
        help="write the result as JSON, too; - prints it in place of all else, as with --quiet",
    )  # fmt: skip
    parser.set_defaults(own_json=(is_own, f"what {parser.prog} --json writes"))


def _target(text: str) -> str:
    return text if text == STDOUT else str(OutputFile(".json")(text))


def has(*keys: str) -> IsOwn:
    """Return what knows objects that have these keys."""
    return lambda found: isinstance(found, dict) and found.keys() >= set(keys)


def each(is_own: IsOwn) -> IsOwn:
    """Return what knows lists and objects of such values."""

    def holds(found: Any) -> bool:
        values = found.values() if isinstance(found, dict) else found if isinstance(found, list) else ()
        return bool(values) and all(map(is_own, values))

    return holds


def check_json(options: argparse.Namespace) -> None:
    """Refuse to write the JSON of a command over a file that holds something else.

    Raises:
        OptionError: so it is.
    """
    target = getattr(options, "json", None)
    if target not in (None, STDOUT):
        check_own(Path(target), *options.own_json)


def check_json_apart(options: argparse.Namespace, *folders: Path | None) -> None:
    """Refuse to write the JSON of a command among other files that it writes.

    Args:
        options: with ``json``.
        folders: of these files; None: there are none.

    Raises:
        OptionError: it is to lie in one of them.
    """
    for folder in folders if options.json not in (None, STDOUT) else ():
        if folder is not None and Path(os.path.realpath(options.json)).is_relative_to(os.path.realpath(folder)):
            raise OptionError(f"--json {options.json}: lies in {folder}, among other results; name a file elsewhere")


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
