"""A sha256 at the end of a file, behind what its readers look at: any byte that has changed is noticed.

torch, zipfile and Stable-Baselines3 read files with it as they do without. Older files have none; of those that are
zips, the checksums of their members are compared, which cover all but a few bytes.
"""

import hashlib
import os
import zipfile
from pathlib import Path
from typing import IO

_MARK = b"\nchmarl_pb sha256 "
LENGTH = len(_MARK) + 64 + 1  # bytes
_END = b"PK\x05\x06"  # begins the last record of a zip,
_END_LENGTH = 22  # which is this long


def seal(path: Path) -> None:
    """Append the sha256 of a file to it."""
    with path.open("r+b") as file:
        digest = _digest(file, path.stat().st_size)
        file.seek(0, os.SEEK_END)
        file.write(line(digest))


def line(sha256: str) -> bytes:
    """Return what stands at the end of a sealed file."""
    return _MARK + sha256.encode() + b"\n"


def is_sealed(path: Path) -> bool:
    """Return whether a file ends with a sha256, right or wrong."""
    return _tail(path).startswith(_MARK)


def fault(path: Path) -> str:
    """Return what is wrong with a file, or nothing.

    Raises:
        OSError: it cannot be read.
    """
    tail = _tail(path)
    with path.open("rb") as file:
        if tail.startswith(_MARK):
            wanted = line(_digest(file, path.stat().st_size - LENGTH))
            return "" if tail == wanted else "some of its bytes have changed since it was written"
        if file.read(2) != b"PK":
            return ""
        if tail[-_END_LENGTH:][: len(_END)] != _END:
            return "its end is missing or has changed"
        return _zip_fault(file)


def _tail(path: Path) -> bytes:
    with path.open("rb") as file:
        file.seek(max(path.stat().st_size - LENGTH, 0))
        return file.read()


def _zip_fault(file: IO[bytes]) -> str:
    try:
        with zipfile.ZipFile(file) as archive:
            if any(member.compress_type != zipfile.ZIP_STORED for member in archive.infolist()):
                return "it is a compressed zip, which no checkpoint is"
            damaged = archive.testzip()
    except Exception:  # whatever a zip's reader makes of bytes that are none
        return "it is no whole zip"
    return f"its part {damaged} is damaged" if damaged else ""


def _digest(file: IO[bytes], length: int) -> str:
    """Return the sha256 of a file's next bytes."""
    digest = hashlib.sha256()
    while part := file.read(min(2**20, length)):
        digest.update(part)
        length -= len(part)
    return digest.hexdigest()
