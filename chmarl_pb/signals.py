"""Signals that end a process, raised as an error that unwinds what it has begun, or handled in another way."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import IO

_PIPE = 13  # the number of SIGPIPE, which not every system has
_NUMBERS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Interrupted(KeyboardInterrupt):
    """A signal has ended the work.

    Attributes:
        number: of the signal.
    """

    def __init__(
        self, number: int, message: str = "interrupted; the same command goes on from what is kept, if anything is"
    ):
        """Say what was saved, and what goes on from it."""
        super().__init__(message)
        self.number = number


def _raise(number: int, frame: FrameType | None) -> None:
    raise Interrupted(number)


@contextmanager
def handled(handler: Callable[[int, FrameType | None], None] = _raise) -> Iterator[None]:
    """Handle the signals that are not ignored (nohup ignores some) as long as a block runs; by default raise them.

    Raises:
        Interrupted: by the default handler.
    """
    main = threading.current_thread() is threading.main_thread()  # signals are its affair alone
    before = {number: signal.getsignal(number) for number in _NUMBERS if main}
    before = {number: known for number, known in before.items() if known not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, known in before.items():
            signal.signal(number, known)


def reader_gone() -> int:
    """Return the exit code of a command whose output nobody reads any more, as ``head`` leaves it; nothing is said.

    It is that of a program which the signal SIGPIPE ends.
    """
    let_go(sys.stdout)
    return 128 + _PIPE


def let_go(stream: IO[str]) -> None:
    """Let what a stream holds and gets yet go nowhere, as nobody reads it any more."""
    with suppress(OSError, ValueError):  # it is no file, or closed
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
