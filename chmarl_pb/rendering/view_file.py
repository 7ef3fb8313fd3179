"""One file of pictures of an empty home, shared by all processes through a memory map.

It holds the pictures of one home by one robot's camera at one size: a table with a checksum for each lattice pose, then
a slot for each. A slot counts only if its checksum is right; any other is drawn and written again. Whoever writes one
writes the same bytes, so no locks are needed. Only slots are read through the map, once they are written: a hole that
is read through a map takes room on some file systems, which ends the process where there is none.
"""

import errno
import mmap
import os
import warnings
import weakref
import zlib
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.rendering.camera import Picture
from chmarl_pb.world import Vector

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]

_PAGE = 4096  # bytes; slots begin at multiples of it
# Colour, depth, segmentation.
_TYPES: tuple[np.dtype, ...] = (np.dtype(np.uint32), np.dtype(np.float32), np.dtype(np.int16))
_NO_COLOURS = np.zeros((0, 0), np.uint32)


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
            warn(str(error))
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
def warn(reason: str) -> None:
    """Warn of each reason once, for which there is no store."""
    warn_of(f"pictures of homes are kept in memory only: {reason}; fix it, or set CHMARL_CACHE=off")


@cache
def warn_of(message: str) -> None:
    """Warn once of something."""
    warnings.warn(message, RuntimeWarning, stacklevel=3)
