"""Signals that end a training: what is done is saved first, one line says how to go on; a second one ends at once."""

import shlex
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any

from chmarl_pb.errors import ChmarlError
from chmarl_pb.signals import Interrupted, handled, reader_gone

EVERY = 60.0  # seconds of work that may be lost when a process is killed; checkpoints are written as often


class StopRequested(BaseException):
    """The work is to end here, at a place where its state is whole."""


class Signals:
    """Notes a signal as long as a block runs; the work asks where it can end. The second one ends the block at once.

    Attributes:
        number: of the signal that was noted, or None.
    """

    def __init__(self) -> None:
        """Note nothing yet."""
        self.number: int | None = None
        self._handling = handled(self._note)

    def check(self) -> None:
        """End the work here if a signal asks for it.

        Raises:
            StopRequested: one does.
        """
        if self.number is not None:
            raise StopRequested

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
        self._handling.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        """Leave signals to those who had them before."""
        self._handling.__exit__(*error)

    def _note(self, number: int, frame: FrameType | None) -> None:
        if self.number is not None:
            raise Interrupted(number)
        self.number = number


def run_command(work: Callable[[], int], error_type: type[Exception] = ChmarlError) -> int:
    """Do the work of a command and return its exit code; where it is not that of the work, one line says why.

    It is 2 after an error, and 128 + N after the signal N, as also where nobody reads the output any more.

    Args:
        work: returns the exit code.
        error_type: of bad input, beside the errors of the package and of files.
    """
    try:
        with handled():
            code = work()
            sys.stdout.flush()
        return code
    except BrokenPipeError:
        return reader_gone()
    except (ChmarlError, OSError, error_type) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt as error:
        found = error if isinstance(error, Interrupted) else Interrupted(signal.SIGINT)
        print(f"{found}: {shlex.join(['python', *sys.orig_argv[1:]])}", file=sys.stderr)
        return 128 + found.number
