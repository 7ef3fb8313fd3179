"""Threads of torch: for networks as small as these, more than one only wait for each other."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_MOST = 1024  # with some thousands torch ends the process


@contextmanager
def threads(count: int = 1) -> Iterator[None]:
    """Let torch use so many threads as long as a block or a decorated function runs.

    Raises:
        ValueError: it is no such number.
    """
    if not isinstance(count, int) or not 1 <= count <= _MOST:
        raise ValueError(f"threads={count!r}: use a whole number from 1 to {_MOST}")
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
