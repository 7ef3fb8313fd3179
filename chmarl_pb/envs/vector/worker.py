"""The whole of what a worker process does: it answers commands with the environments of a batch."""

import os
import pickle
import time
import traceback
from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass
from multiprocessing.connection import Connection
from select import POLLIN, poll
from typing import Any

from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import CloudpickleWrapper

from chmarl_pb.envs.vector.batch import Batch
from chmarl_pb.processes import begin

IN_PARTS = ("reset", "step")  # commands whose answers come in several parts

_WATCH = 0.002  # seconds: most vector steps are shorter, and to wake a sleeping process takes a tenth of one


@dataclass(frozen=True)
class Failure:
    """What went wrong in a worker: the exception and the text of its traceback."""

    error: Exception
    trace: str


def serve(
    commands: Connection, answers: Connection, make: CloudpickleWrapper, numbers: range, autoreset: AutoresetMode
) -> None:
    """Answer commands until the parent has closed its ends of the pipes, be it on purpose or by its death.

    Args:
        commands: from the parent: a method of :class:`Batch` and its arguments, pickled.
        answers: to the parent: what the method returns, of resets and steps part by part, or a :class:`Failure`,
            pickled; the first one, that of ``start``, comes unasked.
        make: makes an environment.
        numbers: of this worker's environments.
        autoreset: when an environment whose episode is over is reset.
    """
    begin()
    try:
        try:
            batch = Batch(make.fn, numbers, autoreset)
        except Exception as error:
            answers.send(failure(error))
            return
        with closing(batch):
            answers.send(batch.start())
            while True:
                command, arguments = pickle.loads(listen(commands))
                for message in _messages(batch, command, arguments):
                    answers.send_bytes(message)
    except (EOFError, ConnectionError):
        return


def listen(pipe: Connection) -> bytes:
    """Return the next message.

    Raises:
        EOFError: the other end was closed.
    """
    watch = poll()
    watch.register(pipe.fileno(), POLLIN)
    wait_for_message(watch)
    return pipe.recv_bytes()


def wait_for_message(watch: poll) -> list[tuple[int, int]]:
    """Return what a poll object finds; it asks for a moment before going to sleep, as messages come in quick turns."""
    end = time.perf_counter() + _WATCH
    while not (found := watch.poll(0)):
        if time.perf_counter() >= end:
            return watch.poll()
        os.sched_yield()
    return found


def _messages(batch: Batch, command: str, arguments: tuple[Any, ...]) -> Iterator[bytes]:
    """Yield the answer to a command, pickled."""
    try:
        answer = getattr(batch, command)(*arguments)
        for message in answer if command in IN_PARTS else (answer,):
            yield pickle.dumps(message, pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        yield pickle.dumps(failure(error))


def failure(error: Exception) -> Failure:
    """Return an error with its traceback; one that cannot travel becomes a RuntimeError with its text."""
    trace = traceback.format_exc()
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    return Failure(error, trace)
