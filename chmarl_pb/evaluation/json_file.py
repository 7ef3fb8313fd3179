"""JSON files that others made: read within limits, and refused in one way whatever they hold."""

import json
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any, TypeVar

from chmarl_pb.errors import OptionError
from chmarl_pb.reading import read_regular

_MOST_BYTES = 64 * 2**20
_Row = TypeVar("_Row")

#: What reading an object of a wrong kind raises, beside what ``read_object`` does.
WRONG = (AttributeError, LookupError, TypeError, ValueError, ArithmeticError, RecursionError)


def read_object(path: Path | str) -> dict[str, Any]:
    """Return the object that a JSON file holds.

    Raises:
        FileNotFoundError: there is no such file.
        ValueError: it is no regular file of at most 64 MB, or no JSON object.
    """
    data = _read(path)
    if not isinstance(data, dict):
        raise ValueError(f"it holds {type(data).__name__}, not an object")
    return data


def _read(path: Path | str) -> Any:
    if not Path(path).exists():
        raise FileNotFoundError(path)
    try:
        return json.loads(read_regular(path, _MOST_BYTES).decode("utf-8"), object_pairs_hook=_object)
    except RecursionError as error:
        raise ValueError("it is nested too deeply") from error


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of a JSON file.

    Raises:
        ValueError: it names one thing twice.
    """
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        raise ValueError(f"it names {next(name for name in names if names.count(name) > 1)!r} twice")
    return found


def check_replaceable(path: Path, kind: str, what: str) -> None:
    """Refuse to write over a file of another kind; an empty one is none.

    Args:
        path: to write.
        kind: the format of files that may be written anew.
        what: such a file is, for the message.

    Raises:
        OptionError: something else is there.
    """
    check_own(path, lambda found: isinstance(found, dict) and found.get("format") == kind, what)


def check_own(path: Path, is_own: Callable[[Any], bool], what: str) -> None:
    """Refuse to write over a file that was not written by whoever writes it now; an empty one is none.

    Args:
        path: to write.
        is_own: tells of what a JSON file holds whether that may be written anew.
        what: such a file is, for the message.

    Raises:
        OptionError: something else is there.
    """
    try:
        if is_own(_read(path)):
            return
    except FileNotFoundError:
        return
    except ValueError:  # no JSON
        pass
    if path.is_dir() or path.stat().st_size:
        raise OptionError(f"{path} is there already and is not {what}; name another file, or remove it")


def plain(row: _Row, **kinds: type | tuple[type, ...]) -> _Row:
    """Return a dataclass after a check of the kinds of its fields.

    Args:
        row: what a file says.
        kinds: field -> what it has to be; bool is no number.

    Raises:
        ValueError: a field is of another kind.
    """
    for field in fields(row):  # type: ignore[arg-type]
        value, kind = getattr(row, field.name), kinds.get(field.name, object)
        if not isinstance(value, kind) or (isinstance(value, bool) and kind not in (bool, object)):
            raise ValueError(f"its {field.name} is {str(value)[:80]!r}")
    return row
