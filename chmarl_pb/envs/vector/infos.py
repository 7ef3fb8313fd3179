"""The infos of many environments: only what has changed travels, and Gymnasium's vector format is made of it."""

from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from math import copysign
from typing import Any

import numpy as np

Info = dict[str, Any]
Path = tuple[str, ...]


class Empty:
    """Stands for a dictionary that holds nothing; the class itself, so that it is the same in any process."""


#: How the info of an environment differs from the one before: path of keys -> new value, and the paths that are gone.
Change = tuple[dict[Path, Any], list[Path]]

_PLAIN = frozenset((bool, int, float, str, type(None)))
_SIMPLE = _PLAIN - {float}  # those that are the same if they are equal
_NOTHING = object()
_WHOLE = "final_obs"  # key whose values stay whole, each by itself, as Gymnasium has it


class ChangeFinder:
    """Compares each info of one environment with the one before."""

    def __init__(self, prefix: Path = ()):
        """Begin with an empty dictionary, which lies under a path of keys."""
        self._prefix = prefix
        self._last: dict[str, Any] = {}  # for inner dictionaries, finders of their own

    def change(self, info: Info) -> Change:
        """Return how an info differs from the last one that was given here."""
        change: Change = ({}, [])
        self._compare(info, change)
        return change

    def _compare(self, info: Info, change: Change) -> None:
        last = self._last
        for key, value in info.items():
            old = last.get(key, _NOTHING)
            if type(value) in _SIMPLE and type(old) is type(value) and old == value:
                continue  # as most of them, at little cost
            inner = isinstance(value, dict) and key != _WHOLE
            if inner and not value:
                inner, value = False, Empty
            if inner is not isinstance(old, ChangeFinder):
                self._forget(key, change)
                old = last[key] = ChangeFinder((*self._prefix, key)) if inner else _NOTHING
            if inner:
                old._compare(value, change)
            elif not _same(old, value):
                path = (*self._prefix, key)
                change[0][path] = value
                last[key] = value.copy() if isinstance(value, np.ndarray) else value
        if len(last) > len(info):
            for key in last.keys() - info.keys():
                self._forget(key, change)

    def _forget(self, key: str, change: Change) -> None:
        old = self._last.pop(key, _NOTHING)
        if isinstance(old, ChangeFinder):
            old._compare({}, change)
        elif old is not _NOTHING:
            change[1].append((*self._prefix, key))


@dataclass(slots=True, eq=False)
class _Entry:
    """What the environments have under one path of keys.

    Attributes:
        outer: path of the dictionary that it lies in.
        key: its key there.
        mask_key: key of its mask there.
        values: one for each environment; None for a dictionary.
        held: how many values each environment has here: 0 or 1, or those in the dictionary.
        total: their sum.
        kind: of the last value: its type, or an array's dtype.
    """

    outer: Path
    key: str
    mask_key: str
    held: np.ndarray
    values: np.ndarray | None = None
    total: int = 0
    kind: Any = None


class InfoTable:
    """The infos of all environments: a column and a mask of environments for each path of keys."""

    def __init__(self, count: int):
        """Begin with empty infos of a number of environments."""
        self._count = count
        self._entries: dict[Path, _Entry] = {}  # each dictionary before what it holds

    def update(self, changes: Sequence[Change], numbers: Sequence[int] | None = None) -> None:
        """Take over the changes of environments with these numbers, or of all in their order."""
        for number, (new, gone) in zip(range(self._count) if numbers is None else numbers, changes, strict=True):
            for path in gone:
                entry = self._entries[path]
                self._clear(entry, number)
                self._hold(path, number, -1)
                if not entry.total:
                    entry.values = None
            for path, value in new.items():
                entry = self._entries.get(path) or self._add(path)
                if value is Empty:
                    self._clear(entry, number)
                else:
                    self._put(entry, number, value)
                if not entry.held[number]:
                    self._hold(path, number, 1)

    def infos(self, numbers: np.ndarray | None = None) -> Info:
        """Return the infos in Gymnasium's vector format: arrays, and for each key a mask with a leading ``_``.

        Args:
            numbers: of the environments whose infos are wanted; None: of all.
        """
        nodes: dict[Path, Info] = {(): {}}
        for path, entry in self._entries.items():
            if not entry.total:
                continue
            mask = (entry.held if numbers is None else entry.held[numbers]) > 0
            if numbers is None or mask.any():
                node = nodes[entry.outer]
                if entry.values is None:
                    node[entry.key] = nodes[path] = {}
                else:
                    node[entry.key] = entry.values.copy() if numbers is None else entry.values[numbers]
                node[entry.mask_key] = mask
        return nodes[()]

    def _add(self, path: Path) -> _Entry:
        """Add an entry, and before it the dictionaries that it lies in."""
        if len(path) > 1 and path[:-1] not in self._entries:
            self._add(path[:-1])
        entry = _Entry(path[:-1], path[-1], f"_{path[-1]}", np.zeros(self._count, np.int32))
        self._entries[path] = entry
        return entry

    def _hold(self, path: Path, number: int, change: int) -> None:
        """Count one value more or less of an environment, in its entry and in the dictionaries around it."""
        for length in range(1, len(path) + 1):
            entry = self._entries[path[:length]]
            entry.held[number] += change
            entry.total += change

    def _clear(self, entry: _Entry, number: int) -> None:
        if entry.values is not None:
            entry.values[number] = _filler(entry.values.dtype)

    def _put(self, entry: _Entry, number: int, value: Any) -> None:
        if entry.values is None or entry.kind is not _kind_of(value):
            self._fit(entry, value)
        assert entry.values is not None
        entry.values[number] = value

    def _fit(self, entry: _Entry, value: Any) -> None:
        """Make or widen a column so that it can hold a value."""
        dtype, shape = _kind(value) if entry.key != _WHOLE else (np.dtype(object), ())
        if entry.values is None:
            entry.values = np.full((self._count, *shape), _filler(dtype), dtype)
        elif entry.values.dtype != dtype:
            entry.values = entry.values.astype(np.result_type(entry.values.dtype, dtype))
        entry.kind = _kind_of(value)


def nest(flat: dict[Path, Any]) -> Info:
    """Return the info of path of keys -> value; what may be changed in place is copied, as DummyVecEnv does."""
    info: Info = {}
    for path, value in flat.items():
        node = info
        for key in path[:-1]:
            node = node.setdefault(key, {})
        node[path[-1]] = _own(value)
    return info


def _own(value: Any) -> Any:
    """Return a value that whoever gets it may change in place."""
    if value is Empty:
        return {}
    if type(value) in _PLAIN or (type(value) is tuple and _PLAIN.issuperset(map(type, value))):
        return value
    return deepcopy(value)


def _same(old: Any, new: Any) -> bool:
    """Return whether two values are surely the same; what may be changed in place is like nothing, not even itself."""
    kind = type(new)
    if type(old) is not kind:
        return False
    if new is Empty:
        return old is Empty
    if kind in _PLAIN:
        return old == new and (kind is not float or copysign(1, old) == copysign(1, new))
    if kind is tuple:
        return _PLAIN.issuperset(map(type, new)) and old == new
    if kind is np.ndarray and not new.dtype.hasobject:
        return bool(old.dtype == new.dtype and old.shape == new.shape and old.tobytes() == new.tobytes())
    return False


def _kind_of(value: Any) -> Any:
    """Return a value's type, or an array's dtype."""
    return value.dtype if isinstance(value, np.ndarray) else type(value)


def _kind(value: Any) -> tuple[np.dtype, tuple[int, ...]]:
    """Return the dtype and the shape that Gymnasium gives a value in the column of its key."""
    if type(value) in (bool, int, float) or isinstance(value, np.number):
        return np.dtype(type(value)), ()
    if isinstance(value, np.ndarray):
        return value.dtype, value.shape
    return np.dtype(object), ()


def _filler(dtype: np.dtype) -> Any:
    """Return what Gymnasium puts in a column where an environment has no such key."""
    return None if dtype.hasobject else dtype.type(0)
