"""Files of others that are read whole: regular ones, of a limited size, without waiting for anybody."""

import os
import stat
from pathlib import Path

MOST_FILE_BYTES = 16 * 2**20  # of a mesh, a material file or a texture


def read_regular(path: Path | str, most: int = MOST_FILE_BYTES) -> bytes:
    """Return the content of a regular file of at most so many bytes.

    Raises:
        ValueError: it does not exist, is no regular file, is larger or cannot be read.
    """
    try:
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise ValueError("is not a regular file; put one there")
        with open(path, "rb", buffering=0, opener=_open_at_once) as file:
            size = os.fstat(file.fileno()).st_size
            if size > most:
                raise ValueError(f"has {size:,} bytes; at most {most:,} are read, make it smaller")
            return file.read(size)
    except FileNotFoundError as error:
        raise ValueError("does not exist") from error
    except OSError as error:
        raise ValueError(f"cannot be read ({error.strerror}); make it readable") from error


def _open_at_once(name: str, flags: int) -> int:
    """Open a file without waiting for another process, should it have become a pipe."""
    return os.open(name, flags | getattr(os, "O_NONBLOCK", 0))
