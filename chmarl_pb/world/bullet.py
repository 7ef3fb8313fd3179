"""PyBullet, imported here alone: without its greeting, from whichever distribution is installed."""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from threading import RLock

_DISTRIBUTIONS = ("pybullet", "pybullet-arm64")  # a fork with packages for more machines; both bring the same module
_redirecting = RLock()  # threads that redirected a descriptor side by side could leave it closed to all


@contextmanager
def quiet(descriptor: int = 1) -> Iterator[None]:
    """Silence what the Bullet library prints from C.

    Args:
        descriptor: 1 for standard output, 2 for standard error.
    """
    with _redirecting:
        _flush()
        try:
            saved = os.dup(descriptor)
        except OSError:  # closed, as in a service: nothing can be printed
            yield
            return
        try:
            sink = os.open(os.devnull, os.O_WRONLY)
            os.dup2(sink, descriptor)
            os.close(sink)
            yield
        finally:
            os.dup2(saved, descriptor)
            os.close(saved)


def _flush() -> None:
    for stream in (sys.stdout, sys.stderr):
        if stream is not None:  # None where there is no console
            with suppress(OSError, ValueError):  # a full disk, closed: its own user will notice
                stream.flush()


with quiet(2):
    import pybullet as pybullet


def distribution() -> tuple[str, str]:
    """Return name and version of the distribution that PyBullet came with."""
    for name in _DISTRIBUTIONS:
        with suppress(PackageNotFoundError):
            return name, version(name)
    return "pybullet", "unknown"
