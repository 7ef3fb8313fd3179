"""Signals that end a training: what is done is saved first, one line says how to go on; a second one ends at once."""

import shlex
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from chmarl_pb.errors import ChmarlError

EVERY = 60.0  # seconds of work that may be lost when a process is killed; checkpoints are written as often

_NUMBERS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


class Interrupted(KeyboardInterrupt):
    """A signal has ended the work.

    Attributes:
        number: of the signal.
    """

    def __init__(self, number: int, message: str = "interrupted; the same command goes on from what is kept"):
        """Say what was saved, and what goes on from it."""
        super().__init__(message)
        self.number = number


class Asked(BaseException):
    """The work is to end here, at a place where its state is whole."""


class Signals:
    """Notes a signal as long as a block runs; the work asks where it can end. The second one ends the block at once.

    Attributes:
        number: of the signal that was noted, or None.
    """

    def __init__(self) -> None:
        """Note nothing yet."""
        self.number: int | None = None
        self._before: dict[int, Any] = {}

    def check(self) -> None:
        """End the work here if a signal asks for it.

        Raises:
            Asked: one does.
        """
        if self.number is not None:
            raise Asked

    def interrupted(self, done: str, place: Any) -> Interrupted:
        """Return what ends the work after it was saved.

        Args:
            done: how much is done, e.g. "5 episodes".
            place: file that has it all; None: it was not saved.
        """
        kept = f"the same command goes on from {place}" if place else "nothing is kept, as no folder was named"
        return Interrupted(self.number or signal.SIGINT, f"interrupted after {done}; {kept}")

    def __enter__(self) -> "Signals":
        """Begin to note."""
        self._before = _handled(self._note)
        return self

    def __exit__(self, *_: object) -> None:
        """Leave signals to those who had them before."""
        for number, handler in self._before.items():
            signal.signal(number, handler)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.number is not None:
            raise Interrupted(number)
        self.number = number


def run_command(work: Callable[[], int], error_type: type[Exception] = ChmarlError) -> int:
    """Do the work of a command and return its exit code; where it is not that of the work, one line says why.

    It is 2 after an error, and 128 + N after the signal N.

    Args:
        work: returns the exit code.
        error_type: of bad input, beside the errors of the package and of files.
    """
    try:
        with _raised():
            return work()
    except (ChmarlError, OSError, error_type) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        found = error if isinstance(error, Interrupted) else Interrupted(signal.SIGINT)
        print(f"{found}: {shlex.join(['python', *sys.orig_argv[1:]])}", file=sys.stderr)
        return 128 + found.number


@contextmanager
def _raised() -> Iterator[None]:
    """Let signals that nobody notes unwind the block."""
    before = _handled(_raise)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _raise(number: int, frame: FrameType | None) -> None:
    raise Interrupted(number)


def _handled(handler: Callable[[int, FrameType | None], None]) -> dict[int, Any]:
    """Handle the signals that are not ignored (nohup ignores some); return how they were handled before."""
    if threading.current_thread() is not threading.main_thread():
        return {}  # signals are the main thread's affair
    before = {number: signal.getsignal(number) for number in _NUMBERS}
    before = {number: known for number, known in before.items() if known not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, handler)
    return before
