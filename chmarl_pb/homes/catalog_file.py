"""Catalogue files: a user's own objects and furniture, one row a class, in TOML (format: docs/objects.md)."""

import os
import re
import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Literal

from chmarl_pb.catalog import BENCHMARK, STRUCTURE, Catalog, Name, ThingClass, names_of
from chmarl_pb.errors import AssetError
from chmarl_pb.fingerprint import sha256_of
from chmarl_pb.homes.source import Source, shown
from chmarl_pb.homes.things import read_thing
from chmarl_pb.homes.urdf import read_whole
from chmarl_pb.kept import Kept
from chmarl_pb.reading import read_regular

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib  # type: ignore[import-not-found, unused-ignore]

OwnKind = Literal["graspable", "receptacle", "scenery"]
#: Kind of a row -> the keys that it may have beside "class".
KEYS: dict[OwnKind, tuple[str, ...]] = {
    "graspable": ("urdf", "names", "held_out", "states", "places"),
    "receptacle": ("models", "names", "held_out", "states"),
    "scenery": ("models", "names", "held_out", "states"),
}

_KEPT: Kept[Catalog] = Kept(16)
_MOST_BYTES = 2**18
_MOST_ROWS = 200
_MOST_WORDS = 16  # names, states or models of a row
_IDENTIFIER = re.compile(r"[a-z]([a-z0-9_]*[a-z])?")
_NAME = re.compile(r"(some )?[a-z0-9]+( [a-z0-9]+){0,3}")
_ARTICLES = ("a", "an", "the", "some")
_STATE = re.compile(r"[a-z][a-z_]{0,30}")
_NAMES = _NAME, "names of one to four words of lower-case letters a to z and digits, without an article"
#: Key of a list of texts -> what each of them has to be, and the same in words.
_TEXTS: dict[str, tuple[re.Pattern[str], str]] = {
    "names": _NAMES,
    "held_out": _NAMES,
    "states": (_STATE, "lower-case words"),
    "places": (_IDENTIFIER, "classes"),
    "models": (re.compile(r".+"), "URDFs"),
}


def load_catalog(path: str | Path) -> Catalog:
    """Return the benchmark's classes with those of a catalogue file after them; files are read once while unchanged.

    Raises:
        AssetError: the file or a URDF that it names cannot be used.
    """
    path = Path(path)
    return _KEPT.get(path.absolute(), path, lambda: _load(path))


def catalog_files(path: Path) -> list[Path]:
    """Return a catalogue file that can be used and all files that it is read from; nothing if there is none.

    Raises:
        AssetError: it cannot be used.
    """
    return _load(path)[1] if path.exists() else []


def _content(path: Path) -> bytes:
    try:
        return read_regular(path, _MOST_BYTES)
    except ValueError as error:
        raise AssetError(f"{path}: {error}; `chmarl-pb things add` makes catalogue files") from error


def _load(path: Path) -> tuple[Catalog, list[Path]]:
    """Return the classes, and the files that they were read from."""
    content, path = _content(path), path.resolve()
    known = _Known()
    rows = [(row, row.read(known)) for row in _rows(path, content)]
    for row, made in rows:
        row.check_places(made, known)
    hashes = [content, *(source.content.encode() for source in known.sources)]
    files = [path, *(file for source in known.sources for file in source.files)]
    return BENCHMARK.extended([made for _, made in rows], sha256_of(hashes), known.furniture), files


@dataclass(frozen=True, eq=False)
class _Known:
    """What rows must not name again: classes, and the names of what instructions name.

    Attributes:
        kinds: class -> its kind.
        words: name -> the class that it names.
        furniture: model -> class and URDF.
        sources: what rows have read, in their order.
    """

    kinds: dict[str, str] = field(default_factory=lambda: {row.name: row.kind for row in BENCHMARK.rows})
    words: dict[str, str] = field(
        default_factory=lambda: {
            words: row.name for row in BENCHMARK.rows if row.kind != "scenery" for words in row.synonyms
        }
    )
    furniture: dict[str, tuple[str, Path]] = field(default_factory=dict)
    sources: list[Source] = field(default_factory=list)


def _rows(path: Path, content: bytes) -> list["_Row"]:
    """Return the rows of a catalogue file by ``order``; else objects, receptacles, scenery, each as in the file."""
    try:
        tables = tomllib.loads(content.decode())
    except (tomllib.TOMLDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise AssetError(f"{path}: not TOML ({error}); fix the file at that place") from error
    for key in tables.keys() - KEYS.keys():
        raise AssetError(f"{path}: {shown(key)} is not known{_nearest(key, KEYS)}; write [[{']], [['.join(KEYS)}]]")
    rows = []
    for kind in KEYS:
        values = tables.get(kind, [])
        if not isinstance(values, list) or not all(isinstance(row, dict) for row in values):
            raise AssetError(f"{path}: {kind} is not a list of tables; write [[{kind}]] before each row")
        rows += [_Row(path, kind, number, row) for number, row in enumerate(values, start=1)]
    if not 0 < len(rows) <= _MOST_ROWS:
        raise AssetError(f"{path}: {len(rows)} rows; a catalogue file has 1 to {_MOST_ROWS}, [[graspable]] begins one")
    return _ordered(rows)


def _ordered(rows: list["_Row"]) -> list["_Row"]:
    """Return rows by the orders that they give themselves, if they do; then no row that is added shifts another."""
    orders = [row.values.get("order") for row in rows]
    if not any(order is not None for order in orders):
        return rows
    for row, order in zip(rows, orders, strict=True):
        if type(order) is not int or order < 1:
            what = "order is missing" if order is None else f"order = {shown(str(order))}"
            raise row.error(f"{what}; as other rows have one, give each a whole number from 1 on")
        if orders.count(order) > 1:
            raise row.error(f"order = {order} stands twice; give every row its own, the next is {_next(orders)}")
    return sorted(rows, key=lambda row: int(row.values["order"]))


def _next(orders: Iterable[Any]) -> int:
    return 1 + max((order for order in orders if type(order) is int), default=0)


def next_order(path: Path) -> int | None:
    """Return the order of a row that is to be added to a catalogue file; None: its rows have none.

    Raises:
        AssetError: the file cannot be used.
    """
    if not path.exists():
        return 1
    orders = [row.values.get("order") for row in _rows(path, _content(path))]
    return None if None in orders else _next(orders)


def text_fault(key: str, value: Any) -> str:
    """Return what is wrong with a class or a list of texts, wherever it stands; empty if nothing is.

    Args:
        key: of a row: "class", "names", "held_out", "states", "places" or "models".
        value: of it.
    """
    if key == "class":
        if isinstance(value, str) and _IDENTIFIER.fullmatch(value) and len(value) <= 40:
            return ""
        form = "a class is lower-case letters, digits and _, with letters at both ends, as rubber_duck"
        return f"class = {shown(str(value))}; {form}"
    rule, what = _TEXTS[key]
    good = isinstance(value, list) and len(value) <= _MOST_WORDS
    if not good or not all(isinstance(text, str) and rule.fullmatch(text) and len(text) < 400 for text in value):
        return f"{key} = {shown(str(value))} is not a list of at most {_MOST_WORDS} {what}"
    if len(set(value)) < len(value):
        return f"{key} = {shown(str(value))} names one twice; name each once"
    return ""


class _Row:
    """One row of a catalogue file; every problem names the file, the row and the key."""

    def __init__(self, path: Path, kind: OwnKind, number: int, values: Mapping[str, Any]):
        self.path, self.kind, self.number, self.values = path, kind, number, values

    def read(self, known: _Known) -> ThingClass:
        """Return the class, and note what it names."""
        self._check_keys()
        name = self._class(known)
        known.kinds[name] = self.kind
        states = tuple(self._texts("states")) or (("intact",) if self.kind == "graspable" else ("fixed",))
        if "held" in states:
            raise self.error("states: 'held' is what the world says of an object in a hand; leave it out")
        names = self._names(name, known)
        model = self._object(name, known) if self.kind == "graspable" else self._furniture(name, known)
        return ThingClass(name, self.kind, states, names, tuple(self._texts("places")), model)

    def check_places(self, row: ThingClass, known: _Known) -> None:
        """Check that the places of an object are receptacles, those of this file included."""
        receptacles = [name for name, kind in known.kinds.items() if kind == "receptacle"]
        for place in row.places:
            if place not in receptacles:
                hint = _nearest(place, receptacles)
                raise self.error(f"places: {place!r} is no receptacle{hint}; name some of: {', '.join(receptacles)}")
        if "places" in self.values and len(row.places) < 2:
            raise self.error("places: a task brings things from one class to another; name at least two")

    def error(self, what: str) -> AssetError:
        """Return a problem of this row."""
        name = self.values.get("class")
        label = f" ({shown(name)})" if isinstance(name, str) else ""
        return AssetError(f"{self.path}: [[{self.kind}]] {self.number}{label}: {what}")

    def _check_keys(self) -> None:
        known = ("class", "order", *KEYS[self.kind])
        for key in self.values.keys() - set(known):
            raise self.error(f"{shown(key)} is no key of such a row{_nearest(key, known)}; use {', '.join(known)}")

    def _class(self, known: _Known) -> str:
        name = self.values.get("class")
        if fault := text_fault("class", name):
            raise self.error(fault)
        name = str(name)
        if name in STRUCTURE:
            raise self.error(f"class {name!r} is part of every home; choose another name")
        if name in BENCHMARK.classes:
            raise self.error(f"class {name!r} is one of the benchmark's, which stay as they are; choose another name")
        if name in known.kinds:
            raise self.error(f"class {name!r} stands twice; give every row its own")
        return name

    def _names(self, name: str, known: _Known) -> tuple[Name, ...]:
        names = names_of(name, self._texts("names"), self._texts("held_out"))
        for entry in names if self.kind != "scenery" else ():  # which no sentence names
            article, _, rest = entry.text.partition(" ")
            if article in _ARTICLES:
                hint = f"write {rest!r}" if rest else "name the thing itself"
                raise self.error(f"the name {entry.text!r} begins with an article, which sentences add; {hint}")
        for words in (entry.text for entry in names if self.kind != "scenery"):
            if known.words.setdefault(words, name) != name:
                raise self.error(f"names: {words!r} names a {known.words[words]}; an instruction must tell them apart")
        return names

    def _object(self, name: str, known: _Known) -> tuple[tuple[str, bytes], ...]:
        source = self._source(self.values.get("urdf"), "urdf")
        try:
            thing = read_thing(source)
        except AssetError as error:
            raise self.error(f"urdf: {error}") from error
        known.sources.append(source)
        return tuple(thing.files(name).items())

    def _furniture(self, name: str, known: _Known) -> tuple[tuple[str, bytes], ...]:
        for text in self._texts("models"):
            source = self._source(text, "models")
            try:
                read_whole(source)
            except AssetError as error:
                raise self.error(f"models: {error}") from error
            if source.urdf.stem in known.furniture:
                raise self.error(f"models: a model {source.urdf.stem!r} stands twice; rename one of the files")
            known.sources.append(source)
            known.furniture[source.urdf.stem] = name, source.urdf.resolve()
        return ()

    def _source(self, name: Any, key: str) -> Source:
        if not isinstance(name, str) or not name:
            raise self.error(f'{key} is missing or no text; write {key} = "{self.values.get("class")}.urdf"')
        try:
            source = Source(self.path, "thing")
            urdf = source.inside(self.path.parent, name)
        except ValueError as error:
            raise self.error(f"{key} = {shown(name)} {error}") from error
        if not os.path.isfile(urdf):
            near = _nearest(name, [file.name for file in sorted(self.path.parent.glob("*.urdf"))[:_MOST_ROWS]])
            raise self.error(f"{key} = {shown(name)}: no such file beside the catalogue file{near}")
        return Source(self.path.parent / name, "thing")

    def _texts(self, key: str) -> list[str]:
        values = self.values.get(key, [])
        if fault := text_fault(key, values):
            raise self.error(fault)
        return [str(text) for text in values]


def _nearest(name: str, known: Iterable[str]) -> str:
    """Return a hint at what may have been meant, or nothing."""
    near = get_close_matches(name, list(known), 1)
    return f"; did you mean {near[0]!r}?" if near else ""
