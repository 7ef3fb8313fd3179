"""Typed access to the tables of a layout file; every problem names the file, the line and the table."""

import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

from chmarl_pb.errors import HomeError
from chmarl_pb.homes.toml_lines import Place, lines_of
from chmarl_pb.reading import read_regular

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found, unused-ignore]

Colour = tuple[float, float, float]
"""Red, green, blue in 0..1."""

_T = TypeVar("_T")
_LARGEST = 1e6  # of any number
_MOST_BYTES = 2**20
_LONGEST_PROBLEM = 500  # characters
_MOST_PROBLEMS = 50


def read_tables(path: Path) -> "Table":
    """Return the top table of a layout file.

    Raises:
        HomeError: the file cannot be read, or is not TOML.
    """
    try:
        text = read_regular(path, _MOST_BYTES).decode("utf-8")
        values = tomllib.loads(text)
        file = File(path, lines_of(text))
    except (ValueError, RecursionError) as problem:  # not a file of such a size, not UTF-8, not TOML, tables in tables
        raise HomeError(f"{path}: cannot be read as TOML: {problem}") from problem
    return Table(values, file, palette=Table(values.get("palette", {}), file, ("palette",)).values)


def read_each(tables: "Iterable[Table]", read: "Callable[[Table], _T]", problems: list[HomeError]) -> tuple[_T, ...]:
    """Return what is read of each table; those that cannot be read are left out, and their problems are noted."""
    found = []
    for table in tables:
        try:
            found.append(read(table))
        except HomeError as problem:
            problems.append(problem)
    return tuple(found)


def refuse(problems: Sequence[HomeError]) -> None:
    """Raise all problems as one, a line each; return if there are none.

    Raises:
        HomeError: there are problems.
    """
    if problems:
        left = [f"... and {len(problems) - _MOST_PROBLEMS} more"] if len(problems) > _MOST_PROBLEMS else []
        raise HomeError("\n".join([*map(str, problems[:_MOST_PROBLEMS]), *left])) from problems[0]


@dataclass(frozen=True)
class File:
    """A layout file, and where in it everything stands."""

    path: Path
    lines: Mapping[Place, int]

    def error(self, place: Place, key: str, problem: str) -> HomeError:
        """Return an error that names the file, the line and the table."""
        line = self.lines.get((*place, key)) or self.lines.get(place)
        where = f"{self.path}:{line}" if line else str(self.path)
        table = " ".join(str(part + 1 if isinstance(part, int) else part) for part in place)
        cut = "..." if len(problem) > _LONGEST_PROBLEM else ""
        return HomeError(f"{where}: {table}{': ' if table else ''}{problem[:_LONGEST_PROBLEM]}{cut}")


class Table:
    """One table of a layout file: typed access that names the file, the line and the table in every error."""

    def __init__(self, values: Any, file: File, place: Place = (), palette: Mapping[str, Any] | None = None):
        self.file, self.place = file, place
        self.palette = palette or {}
        if not isinstance(values, dict):
            raise self.error("must be a table of keys and values")
        self.values = values

    def error(self, problem: str, key: str = "") -> HomeError:
        """Return an error about this table, or about one of its keys."""
        return self.file.error(self.place, key, problem)

    def allow(self, keys: str) -> None:
        """Refuse keys that are not in a list of words."""
        for key in self.values:
            if key not in keys.split():
                raise self.error(f"unknown key {key!r}; known keys: {', '.join(keys.split())}", key)

    def text(self, key: str, pattern: str = "[a-z][a-z0-9_]*") -> str:
        """Return a text that matches a pattern."""
        value = self.values.get(key)
        if not isinstance(value, str) or not re.fullmatch(pattern, value):
            raise self.error(f"{key!r} must be a string that matches {pattern}, got {value!r}", key)
        return value

    def numbers(self, key: str, count: int, default: Sequence[float] | None = None) -> tuple[float, ...]:
        """Return a list of so many numbers."""
        value = self.values.get(key, default)
        if not isinstance(value, (list, tuple)) or len(value) != count or not all(map(_is_number, value)):
            raise self.error(f"{key!r} must be a list of {count} numbers, got {value!r}", key)
        return tuple(float(number) for number in value)

    def number(self, key: str, default: float | None = None, low: float = -math.inf) -> float:
        """Return a number that is not below ``low``."""
        value = self.values.get(key, default)
        if not _is_number(value) or value < low:
            least = f" of at least {low}" if low > -math.inf else ""
            raise self.error(f"{key!r} must be a number{least}, got {value!r}", key)
        return float(value)

    def colour(self, key: str) -> Colour:
        """Return a colour, written as ``#rrggbb`` or as a name from the palette."""
        value = self.values.get(key)
        digits = self.palette.get(value, value) if isinstance(value, str) else value
        if not isinstance(digits, str) or not re.fullmatch("#[0-9a-fA-F]{6}", digits):
            names = ", ".join(self.palette) or "none"
            got = f"{digits!r}, which is {value!r} of the palette" if digits is not value else repr(value)
            raise self.error(f"{key!r} must be a colour '#rrggbb' or a name from the palette ({names}), got {got}", key)
        red, green, blue = (int(digits[i : i + 2], 16) / 255 for i in (1, 3, 5))
        return red, green, blue

    def tables(self, key: str, most: int) -> list["Table"]:
        """Return the tables of an array, none if it is absent."""
        rows = self.values.get(key, [])
        if not isinstance(rows, list):
            raise self.error(f"{key!r} must be an array of tables, got {rows!r}", key)
        if len(rows) > most:
            raise self.error(f"{len(rows):,} tables {key!r}, at most {most:,} are read; remove some", key)
        return [Table(row, self.file, (*self.place, key, number), self.palette) for number, row in enumerate(rows)]


def _is_number(value: Any) -> TypeGuard[float]:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < _LARGEST  # not NaN
