"""Files that appear whole or not at all, are written by one process at a time, and tell when they are damaged."""

import errno
import glob
import hashlib
import json
import os
import re
import shutil
import socket
import stat
import tempfile
import warnings
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from chmarl_pb.errors import BusyError, ChmarlError, OptionError, WriteError

try:
    import fcntl
except ImportError:  # not a POSIX system
    fcntl = None  # type: ignore[assignment]

CHECKSUM = "crc32"  # key of a sealed row

_DISK = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO, errno.EROFS}  # what disks refuse to write with
_UMASK = os.umask(0o077)  # it can only be read by setting it
os.umask(_UMASK)
_PROBE = 2**20  # bytes
_LEFTOVER = re.compile(r"\.(.+)-[a-z0-9_]{8}\.tmp")  # what a killed process leaves of replacing a file


def cache_folder() -> Path | None:
    """Return the user's folder for what can be made again, which need not exist; None if there is to be none.

    ``CHMARL_CACHE`` names it, by default ``chmarl_pb`` in the user's folder for caches; empty or "off" means none.
    """
    chosen = os.environ.get("CHMARL_CACHE")
    if chosen is not None:
        return None if chosen in ("", "off") else Path(os.path.expanduser(chosen)).absolute()
    folder = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    return folder / "chmarl_pb" if folder.is_absolute() else None


def open_folder(folder: Path) -> Path:
    """Make a folder that files can be written to, and return it.

    Raises:
        OptionError: it cannot be made or written to.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OptionError(f"{folder}: cannot write here ({error.strerror}); choose another folder") from error


# Where something may be written


def check_ending(path: Path, ending: str) -> None:
    """Refuse to write a file under a name that means another kind of file.

    Raises:
        OptionError: its name does not have the ending.
    """
    if path.suffix.lower() != ending:
        raise OptionError(f"{path}: let the file's name end in {ending}")


def check_apart(path: Path, sources: Iterable[Path]) -> None:
    """Refuse to write over a file that is read.

    Args:
        path: to write.
        sources: that are read; folders among them may be written to.

    Raises:
        OptionError: the path leads to one of them.
    """
    if any(source.is_file() and path.exists() and path.samefile(source) for source in sources):
        raise OptionError(f"{path}: would be written over, but is read here; name another file")


# Whole or not at all


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside ``path`` that takes its place at the end; nothing is left after an error.

    The folder is made if it is missing. Links are followed; a device or a pipe, as ``/dev/null``, is written to.

    Raises:
        WriteError: a folder is there, the disk is full, or refuses it for another reason.
    """
    if path.is_dir():
        raise WriteError(f"{path}: is a folder; name a file in it, or remove it")
    if path.exists() and not path.is_file():
        with tempfile.TemporaryDirectory() as folder, writing(path, Path(folder)):
            yield (made := Path(folder) / "made")
            with made.open("rb") as source, path.open("wb") as device:
                shutil.copyfileobj(source, device)
        return
    path = Path(os.path.realpath(path)) if path.is_symlink() else path  # of a loop of links, one of them
    _make_folder(path)
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}-", suffix=".tmp", dir=path.parent)
        os.close(handle)
    except OSError as error:
        raise _refused(path, error) from error
    temporary = Path(name)
    try:
        with writing(path, temporary):
            yield temporary
            with temporary.open("rb+") as file:
                os.fsync(file.fileno())  # some disks say only now that they are full
            temporary.chmod(stat.S_IMODE(path.stat().st_mode) if path.exists() else 0o666 & ~_UMASK)
            temporary.replace(path)
    finally:
        temporary.unlink(missing_ok=True)


def remove_leftovers(path: Path) -> None:
    """Remove what killed processes have left of :func:`replacing` a file; whoever calls alone may write it."""
    for temporary in path.parent.glob(f".{glob.escape(path.name)}-*.tmp"):
        temporary.unlink(missing_ok=True)


def replaced_name(path: Path) -> str:
    """Return the name of the file that :func:`replacing` would have replaced by this one, else the name of this one."""
    found = _LEFTOVER.fullmatch(path.name)
    return found[1] if found else path.name


@contextmanager
def writing(path: Path, temporary: Path | None = None) -> Iterator[None]:
    """Name the file if the block fails because the disk does not take what it writes.

    Libraries tell of a full disk in many ways, so the disk itself is asked.

    Args:
        path: the file, as it is named to the user.
        temporary: where it is written meanwhile, a file or a folder; ``path`` itself if None.

    Raises:
        WriteError: the disk is full, or refuses it for another reason.
    """
    try:
        yield
    except ChmarlError:
        raise
    except Exception as error:
        target = temporary or path
        own = isinstance(error, OSError) and error.errno in _DISK and error.filename in (None, str(target))
        reason = error if own else _refusal(target)
        if not isinstance(reason, OSError):
            raise
        raise _refused(path, reason) from error


def _refusal(path: Path) -> OSError | None:
    """Return the error with which the disk refuses to take more of a file, or in a folder, or None if it does not."""
    folder = path if path.is_dir() else path.parent
    try:
        with path.open("ab") if path.is_file() else tempfile.TemporaryFile(dir=folder) as file:
            end = file.seek(0, os.SEEK_END)
            try:
                write_all(file.fileno(), bytes(_PROBE))
                os.fsync(file.fileno())
            finally:
                os.ftruncate(file.fileno(), end)
    except OSError as error:
        return error
    return None


def write_all(file: int, data: bytes) -> None:
    """Write all data to a file's descriptor, or raise an OSError."""
    rest = memoryview(data)
    while rest:
        rest = rest[os.write(file, rest) :]


def _make_folder(path: Path) -> None:
    """Make the folder of a file, if it is missing."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except (FileExistsError, NotADirectoryError) as error:
        files = (above for above in reversed(path.parents) if above.exists() and not above.is_dir())
        file = next(files, error.filename)  # of a link to nowhere itself
        raise WriteError(f"{path}: cannot be written, {file} is no folder; choose another place") from error
    except OSError as error:
        raise _refused(path, error) from error


def _refused(path: Path, error: OSError) -> WriteError:
    reason = os.strerror(error.errno) if error.errno else str(error)
    return WriteError(f"{path}: cannot be written ({reason}); make room, or choose another place")


def write_atomically(path: Path, text: str) -> None:
    """Write a text file, whole or not at all; its folder is made if it is missing.

    Raises:
        WriteError: the disk is full, or refuses it for another reason.
    """
    with replacing(path) as temporary:
        temporary.write_text(text, encoding="utf-8")


def append_line(path: Path, line: str) -> None:
    """Add a line to a text file, whole or not at all.

    Raises:
        WriteError: the disk is full, or refuses it for another reason.
    """
    with writing(path), path.open("ab") as file:
        end = file.seek(0, os.SEEK_END)
        try:
            write_all(file.fileno(), f"{line}\n".encode())
        except BaseException:
            os.ftruncate(file.fileno(), end)
            raise


# One process at a time


class Lock:
    """Makes this process the only one that writes a file, until the lock is closed or the process is gone.

    The system takes the lock back however the process ends, so none is ever stale. A child that inherits ``fileno()``
    holds it as well. Where the file system knows no locks, a warning says so, and work goes on.
    """

    def __init__(self, path: Path, wait: bool = False):
        """Take the lock of a file, which need not exist; its folder is made if it is missing.

        Args:
            path: the file.
            wait: whether to wait for a process that holds it.

        Raises:
            BusyError: another process holds it.
            WriteError: nothing can be written there.
        """
        self._lock = path.with_name(f".{path.name}.lock")
        _make_folder(path)
        try:
            self._file = self._lock.open("a+")
            self._take(path, wait)
            while not self._is_there():  # who held it has removed the file meanwhile
                self._file.close()
                self._file = self._lock.open("a+")
                self._take(path, wait)
        except OSError as error:
            raise _refused(path, error) from error
        with suppress(OSError):
            os.ftruncate(self.fileno(), 0)
            os.write(self.fileno(), f"process {os.getpid()} on {socket.gethostname()}".encode())

    def _take(self, path: Path, wait: bool) -> None:
        try:
            if fcntl is None:
                raise OSError(errno.ENOTSUP, os.strerror(errno.ENOTSUP))
            fcntl.flock(self._file, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
        except BlockingIOError as error:
            self._file.seek(0)
            holder = self._file.read() or "it"
            self._file.close()
            raise BusyError(
                f"{path}: another process is writing it; wait until {holder} has ended, or choose another place"
            ) from error
        except OSError as error:
            warnings.warn(
                f"{path}: the file system cannot lock it ({error.strerror}); let no other process write it meanwhile",
                RuntimeWarning,
                stacklevel=4,
            )

    def _is_there(self) -> bool:
        """Return whether the locked file still has its name."""
        try:
            return os.path.samestat(os.stat(self._lock), os.fstat(self._file.fileno()))
        except FileNotFoundError:
            return False

    def fileno(self) -> int:
        """Return the descriptor that a child has to inherit to hold the lock as well."""
        return self._file.fileno()

    def close(self) -> None:
        """Give the lock back; closing twice is allowed."""
        if self._file.closed:
            return
        with suppress(OSError):
            if self._is_there():
                self._lock.unlink()
        self._file.close()

    def __enter__(self) -> "Lock":
        """Hold the lock as long as a block runs."""
        return self

    def __exit__(self, *_: object) -> None:
        """Give the lock back."""
        self.close()


# Rows that tell when they are damaged


def sealed(row: dict[str, Any], context: str = "") -> str:
    """Return a row as one line of JSON with a checksum.

    Args:
        row: what JSON can hold.
        context: what the row belongs to; a row is good only where it belongs.
    """
    return _plain({**row, CHECKSUM: _checksum(row, context)})


def unsealed(line: str, context: str = "") -> dict[str, Any]:
    """Return the row that ``sealed`` made a line of.

    Raises:
        ValueError: the line is cut or changed, or belongs to something else.
    """
    row = json.loads(line)
    if not isinstance(row, dict) or row.pop(CHECKSUM, None) != _checksum(row, context):
        raise ValueError("its checksum is wrong")
    return row


def unsealed_or_plain(line: str) -> dict[str, Any]:
    """Return the row that ``sealed`` made a line of, or one of plain JSON, as earlier versions wrote it.

    Raises:
        ValueError: the line is cut or changed.
    """
    row = json.loads(line)
    if isinstance(row, dict) and CHECKSUM not in row:
        return row
    return unsealed(line)


def _checksum(row: dict[str, Any], context: str) -> str:
    return f"{zlib.crc32(_plain(row).encode(), zlib.crc32(context.encode())):08x}"


def _plain(row: dict[str, Any]) -> str:
    return json.dumps(row, separators=(",", ":"))


def file_hash(path: Path) -> str:
    """Return the sha256 of a file of any size."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        while block := file.read(2**20):
            digest.update(block)
    return digest.hexdigest()
