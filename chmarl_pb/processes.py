"""Do many small jobs in several processes, none of which outlives the one that started it."""

import os
import signal
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from multiprocessing import parent_process
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread
from typing import Any, TypeVar

from chmarl_pb.errors import OptionError, WorkerError

Job = TypeVar("Job")
Result = TypeVar("Result")

_PATIENCE = 2.0  # seconds that processes get to finish what they are at, when nobody waits for it any more


def in_processes(
    work: Callable[[Job], Result], jobs: Sequence[Job], workers: int, ordered: bool = False
) -> Iterator[Result]:
    """Yield the results of jobs; the processes end with the iterator, and with this process, however it ends.

    Args:
        work: a function of a module; called in another process.
        jobs: its arguments.
        workers: number of processes.
        ordered: whether results come in the order of the jobs; if not, each comes when it is there.

    Raises:
        OptionError: ``workers`` is less than one.
        WorkerError: a process died, or none can be started.
    """
    check_workers(workers)
    if not jobs:
        return
    with _pool(min(workers, len(jobs))) as pool:
        try:
            futures = [pool.submit(work, job) for job in jobs]
        except OSError as error:
            raise _not_started(error) from error
        yield from _in_order(futures) if ordered else _when_done(futures)


def check_workers(workers: int) -> None:
    """Check a number of processes.

    Raises:
        OptionError: it is less than one.
    """
    if workers < 1:
        raise OptionError(f"workers={workers}: use at least 1")


@contextmanager
def _pool(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Start processes, and end them when the block is left, after little time even if they are at work."""
    context = _Context()
    try:
        pool = ProcessPoolExecutor(workers, context, begin)
    except OSError as error:
        raise _not_started(error) from error
    try:
        yield pool
    except BrokenProcessPool as error:
        raise WorkerError("a process died (out of memory?); run the command again, with fewer workers") from error
    finally:
        pool.shutdown(wait=False, cancel_futures=True)
        deadline = time.monotonic() + _PATIENCE
        for process in context.started():
            process.join(max(0.0, deadline - time.monotonic()))
            if process.is_alive():
                process.kill()
                process.join()


class _Context(SpawnContext):
    """Starts processes, and knows them; forked ones would share PyBullet's clients, spawned ones have their own."""

    def __init__(self) -> None:
        self._processes: list[SpawnProcess] = []

    def Process(self, *args: Any, **kwargs: Any) -> SpawnProcess:  # type: ignore[override]
        """Return a process that is to be started."""
        self._processes.append(SpawnProcess(*args, **kwargs))
        return self._processes[-1]

    def started(self) -> list[SpawnProcess]:
        """Return the processes that have been started."""
        return [process for process in self._processes if process.pid is not None]


def _not_started(error: OSError) -> WorkerError:
    return WorkerError(
        f"no process can be started ({error.strerror}); use fewer workers, or free memory or space in /dev/shm"
    )


def _in_order(futures: "list[Future[Result]]") -> Iterator[Result]:
    futures.reverse()
    while futures:
        yield futures.pop().result()


def _when_done(futures: "list[Future[Result]]") -> Iterator[Result]:
    """Yield results as they come; if a process died, all that were there come first."""
    broken: BrokenProcessPool | None = None
    for future in as_completed(futures):
        try:
            result = future.result()
        except BrokenProcessPool as error:
            broken = error
        else:
            yield result
    if broken is not None:
        raise broken


def begin() -> None:
    """Leave interrupts to the parent, and end when it is gone; called by each process that is started to help."""
    for name in {"SIGINT", "SIGHUP"} & set(dir(signal)):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    Thread(target=watch, daemon=True).start()
