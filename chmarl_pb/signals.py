"""Signals that end a process, raised as an error that unwinds what it has begun, or handled in another way."""

import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from functools import partial
from itertools import dropwhile
from pathlib import Path
from types import FrameType
from typing import IO, Any

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


Handler = Callable[[int, FrameType | None], None]


@contextmanager
def handled(handler: Handler | None = None) -> Iterator[None]:
    """Handle the signals that are not ignored (nohup ignores some) as long as a block runs.

    Args:
        handler: is called; None: an error is raised, whatever error a library that is just imported makes of it.

    Raises:
        Interrupted: there is no handler, and a signal came.
    """
    raised: list[Interrupted] = []

    def note(number: int, frame: FrameType | None) -> None:
        raised.append(Interrupted(number))
        raise raised[-1]

    before = _handle(handler or note)
    try:
        yield
    except Exception as error:
        if raised:
            raise raised[0] from error
        raise
    finally:
        for number, known in before.items():
            signal.signal(number, known)


def loading(program: str) -> AbstractContextManager[None]:
    """Let a signal end this process at once, with one line, as long as a block imports what a program needs.

    Nothing is begun by then, and modules that are just imported may lose an error, or show it.
    """
    return handled(partial(_quit, program))


def begin_loading(program: str) -> None:
    """Do the same until the process ends; what the program handles itself goes before."""
    _handle(partial(_quit, program))


def is_program(package: str) -> bool:
    """Return whether Python runs ``chmarl-pb``, or just imports a package for ``python -m`` one of its modules.

    Processes that it starts to help have the arguments of their own start, by which they are none.
    """
    words = sys.orig_argv[1:]
    if sys.argv[:1] == ["-m"]:  # as long as it imports the packages of the module
        named = dropwhile(lambda word: not word.startswith("-m"), words)
        module = next(named, "").removeprefix("-m") or next(named, "")
        return module.partition(".")[0] == package
    return Path(*words[:1]).stem == "chmarl-pb"


def ended_by(number: int) -> str:
    """Return the words for the end by a signal."""
    return "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}"


def _handle(handler: Handler) -> dict[int, Any]:
    """Let a function handle the signals that are not ignored; return who did it before."""
    main = threading.current_thread() is threading.main_thread()  # signals are its affair alone
    before = {number: signal.getsignal(number) for number in _NUMBERS if main}
    before = {number: known for number, known in before.items() if known not in (signal.SIG_IGN, None)}
    for number in before:
        signal.signal(number, handler)
    return before


def _quit(program: str, number: int, frame: FrameType | None) -> None:
    with suppress(OSError):  # nobody reads it
        os.write(2, f"{program}: {ended_by(number)}\n".encode())
    os._exit(128 + number)


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
