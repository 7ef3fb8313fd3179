"""Do many small jobs in several processes, none of which outlives the one that started it."""

import os
import signal
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor
from concurrent.futures import wait as wait_for
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from itertools import islice
from multiprocessing import parent_process, resource_tracker
from multiprocessing.connection import wait
from multiprocessing.context import SpawnContext, SpawnProcess
from threading import Thread
from typing import Any, TypeVar

from chmarl_pb.errors import WorkerError
from chmarl_pb.limits import whole_number

Job = TypeVar("Job")
Result = TypeVar("Result")

#: The error with which results end when a process has died; a block of :func:`pools` makes a sentence of it.
ProcessDiedError = BrokenProcessPool

_AHEAD = 4  # jobs under way for each process
_MOST_WORKERS = 4_096
_PATIENCE = 2.0  # seconds that processes get to finish what they are at, when nobody waits for it any more


def in_processes(
    work: Callable[[Job], Result], jobs: Iterable[Job], workers: int, ordered: bool = False
) -> Iterator[Result]:
    """Yield the results of jobs; the processes end with the iterator, and with this process, however it ends.

    Jobs are taken, and results kept, only a few ahead of what is asked for: neither fills the memory.

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
    with pools(1, workers) as (executor,):
        yield from _results(executor, work, iter(jobs), _AHEAD * workers, ordered)


@contextmanager
def meanwhile(work: Callable[[], object]) -> Iterator[None]:
    """Let another process do something while the block runs, and wait for it at the end, unless the block fails.

    Nothing comes back, not even an error: it is for what only saves time.

    Args:
        work: a function of a module; called in the other process.

    Raises:
        WorkerError: no process can be started.
    """
    with pools(1, 1) as (executor,):
        done = submitted(executor, work)
        yield
        wait_for([done])


def check_workers(workers: int) -> None:
    """Check a number of processes.

    Raises:
        OptionError: it is no whole number, less than one, or more than any machine can start.
    """
    whole_number("workers", workers, 1, _MOST_WORKERS)


@contextmanager
def pools(count: int, workers: int) -> Iterator[list[ProcessPoolExecutor]]:
    """Start processes when there is work, and end them when the block is left, soon even if they are at work.

    Args:
        count: number of pools.
        workers: most processes of each; whichever is free takes the next job of its pool.

    Raises:
        WorkerError: a process died in the block, or none can be started.
    """
    context = _Context()
    try:
        executors = [ProcessPoolExecutor(workers, context, begin) for _ in range(count)]
    except OSError as error:
        raise _not_started(error) from error
    try:
        yield executors
    except BrokenProcessPool as error:
        raise WorkerError(
            "a process died (out of memory?); run the command again, with fewer workers; a script must do such work "
            "under `if __name__ == '__main__':`"
        ) from error
    finally:
        for executor in executors:
            executor.shutdown(wait=False, cancel_futures=True)
        deadline = time.monotonic() + _PATIENCE
        for process in context.started():  # the pool's thread joins them; who joined too might miss how they ended
            if not wait([process.sentinel], max(0.0, deadline - time.monotonic())):
                process.kill()
                wait([process.sentinel])


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


def _results(
    executor: Executor, work: Callable[[Job], Result], jobs: Iterator[Job], most: int, ordered: bool
) -> Iterator[Result]:
    """Yield results, with at most so many jobs under way; if a process died, all that were there come first."""
    futures: list[Future[Result]] = []
    try:
        while True:
            for job in islice(jobs, most - len(futures)):
                futures.append(submitted(executor, work, job))
            if not futures:
                return
            done = wait_for(futures[:1] if ordered else futures, return_when=FIRST_COMPLETED).done
            for future in done:
                result = future.result()
                futures.remove(future)
                yield result
    except BrokenProcessPool:
        yield from (future.result() for future in futures if future.exception() is None)
        raise


def submitted(executor: Executor, work: Callable[..., Result], *job: Any) -> "Future[Result]":
    """Return the result that processes will have of a job.

    Args:
        executor: the processes.
        work: a function of a module; called in one of them.
        job: its arguments.

    Raises:
        WorkerError: no process can be started.
    """
    try:
        with unheard():
            return executor.submit(work, *job)
    except OSError as error:
        raise _not_started(error) from error


@contextmanager
def unheard() -> Iterator[None]:
    """Let processes that are started within not hear interrupts until they ignore them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    resource_tracker.ensure_running()  # which lets them be heard, should it be started within
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _interrupts())
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _interrupts() -> list[int]:
    return [getattr(signal, name) for name in ("SIGINT", "SIGHUP") if hasattr(signal, name)]


def is_helper() -> bool:
    """Return whether another process has started this one to help."""
    return parent_process() is not None


def begin() -> None:
    """Leave interrupts to the parent, and end when it is gone; called by each process that is started to help."""
    for number in _interrupts():
        signal.signal(number, signal.SIG_IGN)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _interrupts())
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    Thread(target=watch, daemon=True).start()
