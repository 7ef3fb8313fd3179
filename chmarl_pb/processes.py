"""Do many small jobs in several processes."""

import os
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from multiprocessing import get_context, parent_process
from multiprocessing.connection import wait
from threading import Thread
from typing import TypeVar

from chmarl_pb.errors import OptionError, WorkerError

Job = TypeVar("Job")
Result = TypeVar("Result")


def in_processes(work: Callable[[Job], Result], jobs: Sequence[Job], workers: int) -> Iterator[Result]:
    """Yield the results of jobs, in no certain order.

    Args:
        work: a function of a module; called in another process.
        jobs: its arguments.
        workers: number of processes.

    Raises:
        OptionError: ``workers`` is less than one.
        WorkerError: a process died.
    """
    if workers < 1:
        raise OptionError(f"workers {workers}: use at least 1")
    if not jobs:
        return
    # Forked children would share PyBullet's clients; spawned ones have their own.
    pool = ProcessPoolExecutor(min(workers, len(jobs)), get_context("spawn"), _begin)
    try:
        futures = [pool.submit(work, job) for job in jobs]
        for future in as_completed(futures):
            yield future.result()
    except BrokenProcessPool as error:
        raise WorkerError("a process died (out of memory?); run the command again, with fewer workers") from error
    finally:
        pool.shutdown(cancel_futures=True)


def _begin() -> None:
    """Leave interrupts to the parent, and end when it is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    assert parent is not None

    def watch() -> None:
        wait([parent.sentinel])
        os._exit(1)

    Thread(target=watch, daemon=True).start()
