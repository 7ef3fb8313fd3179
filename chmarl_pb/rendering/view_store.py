"""Pictures of empty homes on disk, shared by all processes through memory maps.

One sparse file holds the pictures of one home by one robot's camera at one size: a table with a
checksum for each lattice pose, then a slot for each. Its name carries a hash of all that the
pictures depend on, so whoever writes a slot writes the same bytes, and no locks are needed. A slot
counts only if its checksum is right; any other is drawn and written again. Nothing that happens to
the files is an error: what cannot be stored is kept in memory. Only slots are read through the map,
once they are written: a hole that is read through a map takes room on some file systems, which ends
the process where there is none.
"""

import errno
import mmap
import os
import warnings
import weakref
import zlib
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.files import cache_folder
from chmarl_pb.rendering.camera import Picture
from chmarl_pb.world import Vector

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]

FORMAT = 1  # part of the hash in a file's name: raise it when the layout of the files changes
LIMIT = 8192  # MB of disk, unless CHMARL_CACHE_LIMIT says otherwise; the seven homes at 128 pixels take 7620
MEMORY = 384  # MB of kept views in a process, unless CHMARL_VIEW_MEMORY says otherwise

_SUFFIX = ".views"
_PAGE = 4096  # bytes; slots begin at multiples of it
_GRANT = 64 * 2**20  # bytes that a process writes before it measures the folder again, which takes 20 ms
_SHARE = 8  # at most this part of a smaller store
# Colour, depth, segmentation.
_TYPES: tuple[np.dtype, ...] = (np.dtype(np.uint32), np.dtype(np.float32), np.dtype(np.int16))
_NO_COLOURS = np.zeros((0, 0), np.uint32)


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
            _warn(str(error))
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
                status = path.stat()
                found.append(Entry(path, status.st_blocks * 512, status.st_mtime))
        return sorted(found, key=lambda entry: entry.used)

    def clear(self) -> None:
        """Remove all files; processes that use them keep what they have opened."""
        for entry in self.entries():
            entry.path.unlink(missing_ok=True)

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


class ViewFile:
    """The stored pictures of one home by one robot's camera at one size.

    Attributes:
        poses: number of lattice poses.
        slot: bytes of disk space that one picture takes.
        length: bytes of disk space that all of them take.
    """

    def __init__(self, path: Path, poses: int, size: int, grant: Callable[[int], bool], colours: bool = True):
        """Open the file, or make it.

        Args:
            path: the file.
            poses: number of lattice poses.
            size: width and height in pixels.
            grant: asked before each write whether so many bytes may be added.
            colours: whether the pictures have any.

        Raises:
            OSError: it can be neither opened nor made.
            ValueError: it is too short and cannot be written.
        """
        self.poses, self._size, self._grant = poses, size, grant
        self._types = _TYPES if colours else _TYPES[1:]
        self._bytes = size * size * sum(kind.itemsize for kind in self._types)
        self.slot = _whole_pages(self._bytes)
        self._start = _whole_pages(4 * poses)
        self.length = self._start + poses * self.slot
        self._file, self._writable = _open(path)
        weakref.finalize(self, os.close, self._file)
        # A file only ever grows: to shorten one would crash the processes that have mapped it.
        if self._writable and not self._is_whole():
            os.ftruncate(self._file, self.length)
        self._map = mmap.mmap(self._file, self.length, access=mmap.ACCESS_READ)

    def get(self, pose: int, view: Vector) -> Picture | None:
        """Return the stored picture of a pose as read-only views of the file, or None.

        Args:
            pose: the lattice pose.
            view: the camera's view matrix there; a picture from another camera does not count.
        """
        if not self._is_whole() or not (checksum := self._checksums(pose, 1)[0]) or self._has_holes(pose):
            return None
        picture = self._picture(pose)
        return picture if checksum == _checksum(self._parts(picture), view) else None

    def put(self, pose: int, view: Vector, picture: Picture) -> Picture | None:
        """Store a picture and return it as it is in the file, or None if it cannot be stored."""
        if not self._writable or not self._is_whole():
            return None
        parts = self._parts(picture)
        try:
            if not self._grant(self.slot):
                return None
            # Not through the map: on a full disk that would end the process.
            _write(self._file, parts, self._start + pose * self.slot)
            _write(self._file, [np.array([_checksum(parts, view)], np.uint32).data], 4 * pose)
        except OSError as error:
            _warn(str(error))
            self._writable = False
            return None
        return self._picture(pose)

    def gaps(self) -> list[int]:
        """Return the poses that have no picture."""
        return (
            np.flatnonzero(self._checksums(0, self.poses) == 0).tolist()
            if self._is_whole()
            else list(range(self.poses))
        )

    def _checksums(self, first: int, count: int) -> NDArray[np.uint32]:
        """Return a part of the table; 0 stands for no picture."""
        return np.frombuffer(os.pread(self._file, 4 * count, 4 * first).ljust(4 * count, b"\0"), np.uint32)

    def _has_holes(self, pose: int) -> bool:
        """Return whether a part of a slot has never been written."""
        start = self._start + pose * self.slot
        return os.lseek(self._file, start, os.SEEK_HOLE) < start + self._bytes

    def _picture(self, pose: int) -> Picture:
        pixels, offset = self._size * self._size, self._start + pose * self.slot
        arrays: list[NDArray[Any]] = []
        for kind in self._types:
            arrays.append(np.frombuffer(self._map, kind, pixels, offset).reshape(self._size, self._size))
            offset += pixels * kind.itemsize
        depth, links = arrays[-2:]
        return Picture(arrays[0] if len(arrays) == len(_TYPES) else _NO_COLOURS, depth, links)

    def _parts(self, picture: Picture) -> list[memoryview]:
        arrays = (picture.colour, picture.depth, picture.segmentation)[-len(self._types) :]
        return [np.ascontiguousarray(array, kind).data for array, kind in zip(arrays, self._types, strict=True)]

    def _is_whole(self) -> bool:
        """Return whether the file is there in its full length: to read a map beyond its file would end the process."""
        try:
            status = os.fstat(self._file)
        except OSError:
            return False
        return status.st_nlink > 0 and status.st_size >= self.length


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
    _warn_of(f"{variable}={given} is not a whole number of MB; give one, or leave the variable out")
    return None


@cache
def _store(folder: Path, limit: int) -> ViewStore:
    return ViewStore(folder / "views", limit)


def _open(path: Path) -> tuple[int, bool]:
    """Return the file's descriptor, marked as in use, and whether it can be written."""
    try:
        file, writable = os.open(path, os.O_RDWR | os.O_CREAT, 0o644), True
    except OSError:
        file, writable = os.open(path, os.O_RDONLY), False
    with suppress(OSError):
        fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
    with suppress(OSError):
        os.utime(file)
    return file, writable


def _remove_unused(path: Path) -> bool:
    """Remove a file unless a process has it open; return whether it is gone."""
    try:
        with path.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            path.unlink()
    except OSError:
        return False
    return True


def _write(file: int, parts: list[memoryview], offset: int) -> None:
    """Write parts one after the other.

    Raises:
        OSError: not all of them could be written.
    """
    if os.pwritev(file, parts, offset) < sum(part.nbytes for part in parts):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def _checksum(parts: list[memoryview], view: Vector) -> int:
    """Return a checksum of a picture's parts and of the camera that it was drawn with."""
    checksum = zlib.crc32(np.array(view).data)
    for part in parts:
        checksum = zlib.crc32(part, checksum)
    return checksum


def _whole_pages(count: int) -> int:
    return -(-count // _PAGE) * _PAGE


@cache
def _warn(reason: str) -> None:
    """Warn of each reason once, for which there is no store."""
    _warn_of(f"pictures of homes are kept in memory only: {reason}; fix it, or set CHMARL_CACHE=off")


@cache
def _warn_of(message: str) -> None:
    warnings.warn(message, RuntimeWarning, stacklevel=3)
