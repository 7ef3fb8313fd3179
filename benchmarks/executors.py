"""What it costs to hand out jobs, to processes of this machine and to a Ray cluster: python -m benchmarks.executors.

Jobs that do nothing are handed out and their results gathered: small ones, then such with results of 0.5 MB, as an
episode with pictures has. The start of either, processes and imports included, is timed as an evaluation of few tasks.
"""

import argparse
import time
from collections.abc import Sequence
from functools import partial
from statistics import median

import chmarl_pb
from chmarl_pb.executors import Executor, started

_SIZES = {"nothing": 0, "0.5 MB": 500_000}
_TASKS = [f"val-unseen-{number:03d}" for number in range(4)]


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, and print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.partition(":")[0])
    parser.add_argument("--jobs", type=int, default=1000, help="jobs that do nothing (default %(default)s)")
    parser.add_argument("--runs", type=int, default=5, help="whose median is printed (default %(default)s)")
    parser.add_argument("--workers", type=int, default=2, help="processes of this machine (default %(default)s)")
    parser.add_argument("--ray", default="local", metavar="ADDRESS", help="default: a cluster on this machine alone")
    chosen = parser.parse_args(arguments)
    for name in ("processes", "Ray"):
        start = time.perf_counter()
        with started(chosen.workers, None if name == "processes" else chosen.ray) as executor:
            print(f"{name}: joined after {time.perf_counter() - start:.1f} s")
            for turn in ("first", "second"):
                start = time.perf_counter()
                chmarl_pb.evaluate("search", "val-unseen", seeds=[0], tasks=_TASKS, executor=executor)
                print(f"{name}: {turn} evaluation of {len(_TASKS)} tasks took {time.perf_counter() - start:.1f} s")
            for what, size in _SIZES.items():
                taken = [1000 * _seconds_a_job(executor, size, chosen.jobs) for _ in range(chosen.runs)]
                print(f"{name}: {what} back: {median(taken):.2f} ms a job ({min(taken):.2f} to {max(taken):.2f})")


def _seconds_a_job(executor: Executor, size: int, jobs: int) -> float:
    """Return the time from one result to the next, once results come."""
    results = executor.map(partial(_bytes, size), range(jobs + 1))
    next(results)
    start = time.perf_counter()
    assert sum(1 for _ in results) == jobs
    return (time.perf_counter() - start) / jobs


def _bytes(size: int, job: int) -> bytes:
    return bytes(size)


if __name__ == "__main__":  # the processes import this file
    main()
