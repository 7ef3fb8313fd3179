"""What has been read of files of the user's is kept in the process as long as none of these files changes."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Generic, TypeVar

T = TypeVar("T")
Stamps = dict[Path, tuple[int, ...]]


class Kept(Generic[T]):
    """Keeps what was read last, of so many keys."""

    def __init__(self, most: int):
        """Begin with nothing."""
        self._most = most
        self._kept: OrderedDict[Hashable, tuple[Stamps, T]] = OrderedDict()

    def get(self, key: Hashable, first: Path, read: Callable[[], tuple[T, Iterable[Path] | None]]) -> T:
        """Return what has been read, or read it.

        Args:
            key: of it.
            first: file that is read first; which others there are is known when they have been read.
            read: returns it and the files that it was read from; None in their place: it is not to be kept.
        """
        stamps, value = self._kept.get(key, (None, None))
        if stamps is None or value is None or stamps != _stamps(stamps):
            before = _stamps([first])
            value, files = read()
            self._kept.pop(key, None)
            if files is None:
                return value
            self._kept[key] = _stamps(files) | before, value
            if len(self._kept) > self._most:
                self._kept.popitem(last=False)
        self._kept.move_to_end(key)
        return value


def _stamps(files: Iterable[Path]) -> Stamps:
    """Return file -> what changes with it: date, size and number; nothing for one that is gone."""
    found: Stamps = {}
    for file in files:
        with suppress(OSError, ValueError):
            state = file.stat()
            found[file] = (state.st_mtime_ns, state.st_size, state.st_ino)
    return found
