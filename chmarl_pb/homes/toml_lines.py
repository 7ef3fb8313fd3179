"""On which line of a TOML file each of its values stands: ``tomllib`` reads values, but forgets their places."""

import re
from bisect import bisect_left
from collections import Counter

#: Keys and numbers of elements, from the top of the file: ``("furniture", 2, "model")``.
Place = tuple[str | int, ...]

# Strings and comments are single tokens, so that brackets in them do not count.
_TOKENS = re.compile(
    r'"""(?:\\.|[^\\])*?"{3,5}'
    r"|'''.*?'{3,5}"
    r'|"(?:\\.|[^"\\\n])*"'
    r"|'[^'\n]*'"
    r"|#[^\n]*|\n|[\[\]{},=]"
    r"|[^\s\[\]{},=#\"']+",
    re.DOTALL,
)


def lines_of(text: str) -> dict[Place, int]:
    r"""Return the line, counted from 1, of each table, element and key of a file that ``tomllib`` can read.

    >>> lines_of('name = "cabin"\nroom = [\n  { name = "kitchen" },\n]')[("room", 0, "name")]
    3
    """
    lines: dict[Place, int] = {}
    table: Place = ()
    counts: Counter[Place] = Counter()
    tokens = _Tokens(text)
    while token := tokens.peek():
        if token == "\n":
            tokens.take()
        elif token == "[":
            line = tokens.line
            table = _header(tokens, counts)
            lines[table] = line
        else:
            _entry(tokens, table, lines)
    return lines


class _Tokens:
    """The tokens of a file, without its comments."""

    def __init__(self, text: str):
        self._found = [match for match in _TOKENS.finditer(text) if not match[0].startswith("#")]
        self._ends = [match.start() for match in re.finditer("\n", text)]
        self._next = 0

    @property
    def line(self) -> int:
        """Line of the next token, counted from 1."""
        return bisect_left(self._ends, self._found[self._next].start()) + 1

    def peek(self) -> str:
        """Return the next token, or an empty string at the end."""
        return self._found[self._next][0] if self._next < len(self._found) else ""

    def take(self) -> str:
        """Return the next token and go on to the one after it."""
        token = self.peek()
        self._next += 1
        return token


def _header(tokens: _Tokens, counts: "Counter[Place]") -> Place:
    """Return the place of a table by its header: ``[palette]`` or ``[[room]]``."""
    tokens.take()
    if tokens.peek() != "[":
        return _keys(tokens, "]")
    tokens.take()
    keys = _keys(tokens, "]")
    tokens.take()
    counts[keys] += 1
    return (*keys, counts[keys] - 1)


def _keys(tokens: _Tokens, end: str) -> Place:
    """Return the parts of a dotted key, up to the token that ends it."""
    parts = []
    while (token := tokens.take()) != end:
        parts.append(token)
    return tuple(re.findall(r"[^.\s\"']+", "".join(parts)))


def _entry(tokens: _Tokens, table: Place, lines: dict[Place, int]) -> None:
    """Note the lines of ``key = value``."""
    line = tokens.line
    place = (*table, *_keys(tokens, "="))
    lines[place] = line
    _value(tokens, place, lines)


def _value(tokens: _Tokens, place: Place, lines: dict[Place, int]) -> None:
    """Note the lines of what a value holds."""
    opening = tokens.take()
    if opening not in ("[", "{"):
        while tokens.peek() not in (",", "]", "}", "\n", ""):  # a date and a time
            tokens.take()
        return
    number = 0
    while (token := tokens.peek()) not in ("]", "}"):
        if token in (",", "\n"):
            tokens.take()
        elif opening == "{":
            _entry(tokens, place, lines)
        else:
            lines[(*place, number)] = tokens.line
            _value(tokens, (*place, number), lines)
            number += 1
    tokens.take()
