"""Environments of a vector in actors of a Ray cluster, on as many machines as it has; needs the extra ``scale``."""

from collections.abc import Iterator
from itertools import chain, pairwise
from typing import Any

from gymnasium.error import AlreadyPendingCallError, ClosedEnvironmentError, NoAsyncCallError
from gymnasium.vector import AutoresetMode

from chmarl_pb.envs.vector.batch import MakeEnv, PartialAnswer
from chmarl_pb.envs.vector.engine import gathered
from chmarl_pb.envs.vector.memory import Memory, Signature, check_alike
from chmarl_pb.envs.vector.sending import Sent, pickled
from chmarl_pb.envs.vector.share import Share, written
from chmarl_pb.errors import OptionError, WorkerError
from chmarl_pb.extras import needs
from chmarl_pb.ray_cluster import connect, processors
from chmarl_pb.world import Uncopied

with needs("a vector of environments on a Ray cluster", "scale"):
    import ray
    from ray.exceptions import RayActorError


class RayEngine(Uncopied):
    """Environments in shares, each in an actor; commands and answers are those of :class:`Engine`.

    There is no shared memory between machines, so actions and what is observed travel with the commands and answers.

    Attributes:
        signature: what each of the environments is like.
        memory: what they have written and are to read, in this process.
    """

    _instead = "make another vector of environments"

    def __init__(self, make: MakeEnv, count: int, workers: int | None, autoreset: AutoresetMode):
        """Start actors in the cluster that this process has joined, else in that of ``RAY_ADDRESS`` or this machine.

        Args:
            make: makes an environment; sent to the actors by cloudpickle.
            count: number of environments.
            workers: number of actors, each with a processor; None: one for each processor of the cluster.
            autoreset: when an environment whose episode is over is reset.

        Raises:
            OptionError: there is no cluster, it has fewer processors, or the environment holds what cannot be sent.
            WorkerError: an actor died.
        """
        content = Sent(pickled(make, "the environment"))
        self._joined = connect("auto")
        free = int(processors())
        number = min(free if workers is None else max(workers, 1), count)
        if not 1 <= number <= free:
            raise OptionError(f"workers={workers}: the Ray cluster has {free} processors, and each worker takes one")
        bounds = [count * place // number for place in range(number + 1)]
        self._shares = [range(low, high) for low, high in pairwise(bounds)]
        self._closed, self._command, self._answers = False, "", list[Any]()
        sent = ray.put(content)
        self._actors = [_actor.remote(sent, share, count, autoreset) for share in self._shares]
        try:
            check_alike(list(chain(*self._get([actor.spaces.remote() for actor in self._actors]))))
            self.signature: Signature = self._get([self._actors[0].signature.remote()])[0]
        except BaseException:
            self.close()
            raise
        self.memory = Memory(self.signature, count)

    @property
    def pending(self) -> bool:
        """Whether a command has not been answered yet."""
        return bool(self._command)

    def send(self, command: str, *arguments: Any) -> None:
        """Let the actors begin with a command."""
        if self._closed:
            raise ClosedEnvironmentError("the vector environment is closed, by close() or by an error; make a new one")
        if self.pending:
            raise AlreadyPendingCallError("the answer to the last command has not been waited for", "send")
        actions, shared = self.memory.actions, ray.put(arguments)
        self._command = command
        self._answers = [
            actor.do.remote(command, shared, actions[share.start : share.stop].copy())
            for actor, share in zip(self._actors, self._shares, strict=True)
        ]

    def receive(self) -> list[Any]:
        """Wait for the actors; return an answer of each environment, in their order.

        Raises:
            WorkerError: an actor died; the others have been stopped.
            Exception: what went wrong in an environment; unless it was an attribute, all have been closed.
        """
        if not self.pending:
            raise NoAsyncCallError("there is no command to wait for", "receive")
        try:
            answers = self._get(self._answers)
        except BaseException:  # an interrupt too: nobody knows which environments have been stepped
            self.close()
            raise
        command, self._command = self._command, ""
        for share, (_, rows) in zip(self._shares, answers, strict=True):
            for array, row in zip(written(self.memory), rows, strict=False):
                array[share.start : share.stop] = row
        return gathered(self._shares, [answer for answer, _ in answers], command, self.close)

    def parts(self) -> Iterator[PartialAnswer]:
        """Yield the answer to a reset or a step, all of it at once; see :meth:`receive`."""
        changes = self.receive()
        yield PartialAnswer(list(range(len(changes))), changes)

    def _get(self, refs: list[Any]) -> list[Any]:
        try:
            return list(ray.get(refs))
        except RayActorError as error:
            first = str(error).strip().partition("\n")[0]
            raise WorkerError(f"a worker on the Ray cluster died; all have been stopped ({first})") from error

    def close(self) -> None:
        """Close the environments and end the actors; closing twice is allowed."""
        if not self._closed:
            self._closed = True
            for actor in self._actors:
                ray.kill(actor)
            if self._joined:
                ray.shutdown()


_actor: Any = ray.remote(num_cpus=1)(Share)
