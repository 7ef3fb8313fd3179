"""Runs that are asked to end again and again, as signals do it."""

from collections.abc import Callable
from typing import Any

import pytest

from chmarl_pb.learning.runs.interrupts import Signals, StopRequested
from chmarl_pb.signals import Interrupted


def in_pieces(work: Callable[[], Any], every: int, patch: pytest.MonkeyPatch) -> tuple[Any, int]:
    """Do some work that is asked to end at every so many places where it can; return its result, and how often it was.

    Args:
        work: goes on where it was interrupted.
        every: places between two interruptions.
        patch: undoes itself.
    """
    places = 0

    def check(signals: Signals) -> None:
        nonlocal places
        places += 1
        if places % every == 0:
            raise StopRequested

    patch.setattr(Signals, "check", check)
    for times in range(200):
        try:
            return work(), times
        except Interrupted as error:
            assert "interrupted after" in str(error)
    raise AssertionError("the work never ends")
