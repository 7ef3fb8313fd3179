"""Pictures of empty homes on disk, shared by all processes: a folder of files with a limit of its size.

The name of a file (:mod:`chmarl_pb.rendering.view_file`) carries a hash of all that the pictures depend on, so whoever
writes a picture writes the same bytes. Nothing that happens to the files is an error: what cannot be stored is kept in
memory.
"""

import os
import stat
import weakref
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from chmarl_pb.files import cache_folder
from chmarl_pb.rendering.view_file import ViewFile, warn, warn_of

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]

FORMAT = 1  # part of the hash in a file's name: raise it when the layout of the files changes
LIMIT = 8192  # MB of disk, unless CHMARL_CACHE_LIMIT says otherwise; the seven homes at 128 pixels take 7620
MEMORY = 384  # MB of kept views in a process, unless CHMARL_VIEW_MEMORY says otherwise

_SUFFIX = ".views"
_GRANT = 64 * 2**20  # bytes that a process writes before it measures the folder again, which takes 20 ms
_SHARE = 8  # at most this part of a smaller store


@dataclass(frozen=True)
class Entry:
    """One file of the store.

    Attributes:
        path: the file.
        bytes: disk space that it takes.
        used: when a process opened it last or wrote to it, seconds since the epoch.
    """

    path: Path
    bytes: int
    used: float


class ViewStore:
    """A folder of pictures with a limit of its size on disk.

    Attributes:
        folder: the folder, which need not exist yet.
        limit: in bytes.
        files: those that this process has open.
    """

    def __init__(self, folder: Path, limit: int):
        """Use a folder up to a limit in bytes."""
        self.folder, self.limit = folder, limit
        self.files: weakref.WeakSet[ViewFile] = weakref.WeakSet()
        self._granted = 0

    def open(self, name: str, poses: int, size: int, colours: bool = True) -> "ViewFile | None":
        """Open the file for the pictures of one home, robot and size, or return None if that cannot be done.

        Args:
            name: the file's name; it tells apart all that the pictures depend on.
            poses: number of lattice poses.
            size: width and height in pixels.
            colours: whether the pictures have any.
        """
        try:
            self.folder.mkdir(parents=True, exist_ok=True)
            file = ViewFile(self._path(name), poses, size, self._grant, colours)
        except (OSError, ValueError) as error:
            warn(str(error))
            return None
        self.files.add(file)
        return file

    def has(self, name: str) -> bool:
        """Return whether there is a file of this name."""
        return self._path(name).exists()

    def _path(self, name: str) -> Path:
        return self.folder / f"{name}{_SUFFIX}"

    def entries(self) -> list[Entry]:
        """Return the files, that which was not used for longest first."""
        found = []
        for path in self.folder.glob(f"*{_SUFFIX}"):
            with suppress(OSError):  # another process may just have removed it
                status = path.lstat()
                if stat.S_ISDIR(status.st_mode):
                    continue  # no file of the store
                found.append(Entry(path, status.st_blocks * 512, status.st_mtime))
        return sorted(found, key=lambda entry: entry.used)

    def _grant(self, wanted: int) -> bool:
        """Return whether so many bytes may be written, and count them."""
        if self._granted < wanted:
            portion = max(wanted, min(_GRANT, self.limit // _SHARE))
            self._granted = min(portion, self._make_room(portion))
        if self._granted < wanted:
            return False
        self._granted -= wanted
        return True

    def _make_room(self, wanted: int) -> int:
        """Remove files that nobody uses until there is room, those unused for longest first; return the room."""
        entries = self.entries()
        room = self.limit - sum(entry.bytes for entry in entries)
        for entry in entries:
            if room >= wanted:
                break
            if _remove_unused(entry.path):
                room += entry.bytes
        return room


def view_store() -> ViewStore | None:
    """Return the store that the environment variables ask for, or None for none.

    ``CHMARL_CACHE`` is its folder, by default ``chmarl_pb`` in the user's folder for caches; empty or
    "off" means no store. ``CHMARL_CACHE_LIMIT`` is its limit in MB.
    """
    folder = cache_folder()
    if folder is None or fcntl is None or not hasattr(os, "pwritev") or not hasattr(os, "SEEK_HOLE"):
        return None
    limit = _megabytes("CHMARL_CACHE_LIMIT", LIMIT)
    return None if limit is None else _store(folder, limit)


def view_memory() -> int:
    """Return how many bytes of views a process keeps: ``CHMARL_VIEW_MEMORY`` MB, without those on disk."""
    kept = _megabytes("CHMARL_VIEW_MEMORY", MEMORY)
    return MEMORY * 2**20 if kept is None else kept


def _megabytes(variable: str, default: int) -> int | None:
    """Return what an environment variable says in MB as bytes, or None, with a warning, if it is no number."""
    given = os.environ.get(variable) or str(default)
    if given.isdecimal():
        return int(given) * 2**20
    warn_of(f"{variable}={given} is not a whole number of MB; give one, or leave the variable out")
    return None


@cache
def _store(folder: Path, limit: int) -> ViewStore:
    return ViewStore(folder / "views", limit)


def _remove_unused(path: Path) -> bool:
    """Remove a file unless a process has it open; return whether it is gone."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink()
    except OSError:
        return False
    return True
