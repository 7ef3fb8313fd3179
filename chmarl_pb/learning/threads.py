"""Threads of torch: for networks as small as these, more than one only wait for each other."""

from collections.abc import Iterator
from contextlib import contextmanager

import torch

from chmarl_pb.limits import whole_number

_MOST = 1024  # with some thousands torch ends the process


@contextmanager
def threads(count: int = 1) -> Iterator[None]:
    """Let torch use so many threads as long as a block or a decorated function runs.

    Raises:
        OptionError: it is no such number.
    """
    wanted = whole_number("threads", count, 1, _MOST)
    before = torch.get_num_threads()
    torch.set_num_threads(wanted)
    try:
        yield
    finally:
        torch.set_num_threads(before)
