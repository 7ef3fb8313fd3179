"""Threads of torch: for networks as small as these, more than one only wait for each other."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch


@contextmanager
def threads(count: int = 1) -> Iterator[None]:
    """Let torch use so many threads as long as a block or a decorated function runs.

    Raises:
        ValueError: it is none.
    """
    if count < 1:
        raise ValueError(f"threads={count}: use at least 1")
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)
