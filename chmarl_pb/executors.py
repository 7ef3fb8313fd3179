"""Where jobs are done: in processes of this machine, or wherever an object of the protocol below does them.

Every command that spreads its work takes one: ``chmarl_pb.ray_executor.RayExecutor`` does the same jobs on a cluster.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Protocol

from chmarl_pb.processes import Job, Result, check_workers, in_processes


class Executor(Protocol):
    """Does jobs somewhere.

    Attributes:
        workers: number of jobs that are done at a time.
        alone: whether that is one, on this machine, so that the caller may do them as well by itself.
        worthwhile: number of short jobs, of some hundredths of a second, that are better sent as one.
    """

    @property
    def workers(self) -> int:
        """Number of jobs that are done at a time."""

    @property
    def alone(self) -> bool:
        """Whether that is one, on this machine."""

    @property
    def worthwhile(self) -> int:
        """Number of short jobs that are better sent as one."""

    def map(self, work: Callable[[Job], Result], jobs: Iterable[Job], ordered: bool = False) -> Iterator[Result]:
        """Yield the results of jobs; when the iterator is closed, what is not done yet is given up.

        Args:
            work: a function of a module, or a partial of one. It writes no files that anybody asked for, and its
                result depends on nothing but its arguments: it may be done anywhere, and again if a machine is lost.
            jobs: its arguments, taken only a few ahead of the results.
            ordered: whether results come in the order of the jobs; if not, each comes when it is there.

        Raises:
            WorkerError: a process died, or a job was lost again and again.
        """

    def everywhere(self, work: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[Result]:
        """Yield the results of jobs that are done once on each machine, as they come: to fill what each keeps."""


class Local:
    """Processes of this machine; with one worker callers may do the jobs themselves."""

    worthwhile = 1

    def __init__(self, workers: int):
        """Start nothing yet: processes start with each ``map`` and end with it.

        Raises:
            OptionError: ``workers`` is less than one.
        """
        check_workers(workers)
        self.workers = int(workers)

    @property
    def alone(self) -> bool:
        """Whether there is one worker."""
        return self.workers == 1

    def map(self, work: Callable[[Job], Result], jobs: Iterable[Job], ordered: bool = False) -> Iterator[Result]:
        """Yield the results of jobs; see :class:`Executor`."""
        return in_processes(work, jobs, self.workers, ordered)

    def everywhere(self, work: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[Result]:
        """Yield the results of jobs: there is one machine."""
        return self.map(work, jobs)


@contextmanager
def started(workers: int, ray: str | None, files: Sequence[Path] = ()) -> Iterator[Executor]:
    """Yield who does the work: processes of this machine, or a Ray cluster where its address is given.

    Args:
        workers: number of processes.
        ray: the cluster's address, see :class:`chmarl_pb.ray_executor.RayExecutor`; None: this machine.
        files: of the user's, that a cluster is sent.

    Raises:
        OptionError: ``workers`` is less than one, or no cluster answers.
        MissingExtraError: Ray is asked for and not installed.
    """
    if ray is None:
        yield Local(workers)
        return
    from chmarl_pb.ray_executor import RayExecutor  # which not everybody has

    with RayExecutor(ray, files) as executor:
        yield executor


def executor_of(executor: Executor | None, workers: int) -> Executor:
    """Return the executor that was given, else processes of this machine.

    Raises:
        OptionError: ``workers`` is less than one.
    """
    return Local(workers) if executor is None else executor
