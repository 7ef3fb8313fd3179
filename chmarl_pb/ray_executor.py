"""Jobs on a Ray cluster: its tasks, its retries, its object store; needs the extra ``scale``."""

import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

from chmarl_pb.errors import OptionError, WorkerError
from chmarl_pb.extras import needs
from chmarl_pb.processes import Job, Result
from chmarl_pb.ray_cluster import connect, processors

with needs("work on a Ray cluster", "scale"):
    import ray
    from ray.exceptions import RayError, RayTaskError
    from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

_ray: Any = ray  # parts of it have no types
_AHEAD = 2  # jobs under way for each worker: one that is done, one that is there when it is over
_SHORT, _SHARE = 8, 8  # short jobs that are sent as one: at least so many, and one for so many workers
_RETRIES = 5  # times that a job is done again whose process or machine is lost

Own = TypeVar("Own", bound="RayExecutor")


class RayExecutor:
    """Does jobs as tasks of a Ray cluster, whose results do not depend on which machines it has.

    A task whose process or node is lost is done again elsewhere. What nodes keep (pictures of homes, generated homes)
    lies in the cache folder of each, and the environments of a process live as long as Ray keeps the process.

    Example::

        with RayExecutor("10.0.0.1:6379") as executor:
            report = chmarl_pb.evaluate("search", "val-unseen", executor=executor)
    """

    alone = False

    def __init__(
        self,
        address: str = "auto",
        files: Iterable[str | Path] = (),
        cpus: float = 1,
        runtime_env: Mapping[str, Any] | None = None,
    ):
        """Join a cluster, or use the one that this process has joined by ``ray.init``, with what that ships.

        Args:
            address: see :func:`chmarl_pb.ray_cluster.connect`, as for ``files`` and ``runtime_env``.
            files: own files that the jobs read.
            cpus: processors that each job takes.
            runtime_env: more of Ray's runtime environment.

        Raises:
            OptionError: no cluster answers, it has no processors, or a file cannot be shipped.
            MissingExtraError: Ray is not installed.
        """
        self._cpus, self._joined = cpus, connect(address, files, runtime_env)
        if not processors() >= cpus:
            self.close()
            raise OptionError(f"the Ray cluster at {address!r} has no {cpus:g} processors for jobs")

    def __enter__(self: Own) -> Own:
        """Return this; the cluster is left at the end of the block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Leave the cluster."""
        self.close()

    def close(self) -> None:
        """Leave the cluster, if this has joined it."""
        if self._joined:
            ray.shutdown()
            self._joined = False

    @property
    def workers(self) -> int:
        """Number of jobs that the cluster as it is now can do at a time."""
        return max(1, int(processors() / self._cpus))

    @property
    def worthwhile(self) -> int:
        """Number of short jobs that are better sent as one: this process hands out only some hundred a second."""
        return max(_SHORT, self.workers // _SHARE)

    def map(self, work: Callable[[Job], Result], jobs: Iterable[Job], ordered: bool = False) -> Iterator[Result]:
        """Yield the results of jobs; see :class:`chmarl_pb.executors.Executor`."""
        task, sent = _task.options(num_cpus=self._cpus, max_retries=_RETRIES), ray.put(work)
        yield from map(_result, self._done((task.remote(sent, job) for job in jobs), ordered))

    def everywhere(self, work: Callable[[Job], Result], jobs: Iterable[Job]) -> Iterator[Result]:
        """Yield the results of jobs, each done once on each node that there is now; lost nodes are left out."""
        sent, chosen = ray.put(work), list(jobs)
        tasks = [
            _task.options(num_cpus=self._cpus, scheduling_strategy=NodeAffinitySchedulingStrategy(node, soft=False))
            for node in _nodes()
        ]
        for ref in self._done((task.remote(sent, job) for job in chosen for task in tasks), ordered=False):
            try:
                yield _result(ref)
            except WorkerError as error:
                warnings.warn(f"a node is left out: {error}", RuntimeWarning, stacklevel=2)

    def _done(self, refs: Iterator[Any], ordered: bool) -> Iterator[Any]:
        """Yield references to results that are there; only so many are under way that no machine waits for the next."""
        waiting: list[Any] = []
        try:
            while True:
                waiting += islice(refs, max(0, _AHEAD * self.workers - len(waiting)))
                if not waiting:
                    return
                ready, _ = ray.wait(waiting[:1] if ordered else waiting, num_returns=1)
                waiting.remove(ready[0])
                yield ready[0]
        finally:
            for ref in waiting:
                ray.cancel(ref)


def _do(work: Callable[[Job], Result], job: Job) -> Result:
    """Do a job on a node."""
    return work(job)


_task: Any = ray.remote(_do)


def _result(ref: Any) -> Any:
    """Return a result, or raise what was raised in its job.

    Raises:
        WorkerError: the job was lost, and again whenever it was done anew.
    """
    try:
        return ray.get(ref)
    except RayTaskError as error:
        raise error.cause from error
    except RayError as error:
        first = str(error).strip().partition("\n")[0]
        raise WorkerError(f"a job was lost on the Ray cluster, {_RETRIES} retries included: {first}") from error


def _nodes() -> list[str]:
    """Return the ids of the nodes that have processors."""
    return [node["NodeID"] for node in _ray.nodes() if node["Alive"] and node["Resources"].get("CPU")]
