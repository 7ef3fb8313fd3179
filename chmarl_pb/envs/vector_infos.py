"""The infos of many environments: only what has changed travels, and Gymnasium's vector format is made of it."""

from collections.abc import Sequence
from math import copysign
from typing import Any

import numpy as np

Info = dict[str, Any]
Path = tuple[str, ...]

#: How the info of an environment differs from the one before: path of keys -> new value, and the paths that are gone.
Change = tuple[dict[Path, Any], list[Path]]

_PLAIN = frozenset((bool, int, float, str, type(None)))
_NOTHING = object()


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
            inner = isinstance(value, dict) and key != "final_obs"  # observations stay whole, as Gymnasium has it
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


class InfoTable:
    """The infos of all environments: a column and a mask of environments for each path of keys."""

    def __init__(self, count: int):
        """Begin with empty infos of a number of environments."""
        self._count = count
        self._columns: dict[Path, np.ndarray] = {}
        self._kinds: dict[Path, Any] = {}  # of the last value in a column: its type, or an array's dtype
        self._masks: dict[Path, np.ndarray] = {}
        #: For each entry: number of the dictionary that it lies in, its key, its mask's key, its column, its mask;
        #: an entry without a column is a dictionary, the numbers count them from the outermost, 0.
        self._plan: list[tuple[int, str, str, np.ndarray | None, np.ndarray]] = []
        self._stale = False  # whether the plan is to be made anew

    def update(self, changes: Sequence[Change]) -> None:
        """Take over the changes of all environments, in their order."""
        for number, (new, gone) in enumerate(changes):
            for path in gone:
                self._columns[path][number] = _filler(self._columns[path].dtype)
                self._masks[path][number] = False
                self._stale = True
            for path, value in new.items():
                if self._kinds.get(path) is not (value.dtype if isinstance(value, np.ndarray) else type(value)):
                    self._fit(path, value)
                self._columns[path][number] = value
                if not self._masks[path][number]:
                    self._masks[path][number] = self._stale = True

    def infos(self) -> Info:
        """Return the infos in Gymnasium's vector format: arrays, and for each key a mask with a leading ``_``."""
        if self._stale:
            self._tidy()
        nodes: list[Info] = [{}]
        for outer, key, mask_key, column, mask in self._plan:
            node = nodes[outer]
            if column is None:
                node[key] = {}
                nodes.append(node[key])
            else:
                node[key] = column.copy()
            node[mask_key] = mask.copy()
        return nodes[0]

    def _fit(self, path: Path, value: Any) -> None:
        """Make or widen the column of a path so that it can hold a value."""
        dtype, shape = _kind(value)
        column = self._columns.get(path)
        if column is None:
            self._columns[path] = np.full((self._count, *shape), _filler(dtype), dtype)
            self._masks[path] = np.zeros(self._count, dtype=np.bool_)
        elif column.dtype != dtype:
            self._columns[path] = column.astype(np.result_type(column.dtype, dtype))
        self._stale = True
        self._kinds[path] = value.dtype if isinstance(value, np.ndarray) else type(value)

    def _tidy(self) -> None:
        """Drop empty columns and plan the infos: each dictionary, with the mask of all in it, before what it holds."""
        self._masks = {path: mask for path, mask in self._masks.items() if mask.any()}
        self._columns = {path: self._columns[path] for path in self._masks}
        self._kinds = {path: self._kinds[path] for path in self._masks}
        all_masks: dict[Path, np.ndarray] = {}
        for path, mask in self._masks.items():
            for length in range(1, len(path)):
                all_masks[path[:length]] = all_masks.get(path[:length], False) | mask
            all_masks[path] = mask
        nodes: dict[Path, int] = {(): 0}
        self._plan = []
        for path, mask in all_masks.items():
            column = self._columns.get(path)
            self._plan.append((nodes[path[:-1]], path[-1], f"_{path[-1]}", column, mask))
            if column is None:
                nodes[path] = len(nodes)
        self._stale = False


def nest(flat: dict[Path, Any]) -> Info:
    """Return the info of path of keys -> value."""
    info: Info = {}
    for path, value in flat.items():
        node = info
        for key in path[:-1]:
            node = node.setdefault(key, {})
        node[path[-1]] = value
    return info


def _same(old: Any, new: Any) -> bool:
    """Return whether two values are surely the same; what may be changed in place is like nothing, not even itself."""
    kind = type(new)
    if type(old) is not kind:
        return False
    if kind in _PLAIN:
        return old == new and (kind is not float or copysign(1, old) == copysign(1, new))
    if kind is tuple:
        return _PLAIN.issuperset(map(type, new)) and old == new
    if kind is np.ndarray and not new.dtype.hasobject:
        return old.dtype == new.dtype and old.shape == new.shape and old.tobytes() == new.tobytes()
    return False


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
