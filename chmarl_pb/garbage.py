"""Python's collector of cyclic garbage: it goes through all that lives whenever much is made, as for a new home."""

import gc
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def uncollected() -> Iterator[None]:
    """Make many things that will live, without the collector going through them all again and again meanwhile.

    A full collection takes 0.1 s in a process with torch. It is only put off: one that comes due runs afterwards.
    """
    if not gc.isenabled():  # the user's choice, or we are within another of these
        yield
        return
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
