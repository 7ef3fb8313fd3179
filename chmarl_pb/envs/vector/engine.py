"""Where the environments of a vector live: in this process and in workers, with memory that all share."""

import os
import pickle
import time
import weakref
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from itertools import pairwise
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from select import POLLIN, poll
from typing import Any, Protocol

from gymnasium.error import AlreadyPendingCallError, ClosedEnvironmentError, NoAsyncCallError
from gymnasium.vector import AutoresetMode

from chmarl_pb.envs.vector.batch import Batch, MakeEnv, PartialAnswer
from chmarl_pb.envs.vector.memory import Memory, Signature, check_alike, shared_file
from chmarl_pb.envs.vector.sending import Sent, pickled
from chmarl_pb.envs.vector.worker import Failure, listen, serve, wait_for_message
from chmarl_pb.errors import WorkerError
from chmarl_pb.processes import unheard
from chmarl_pb.world import Uncopied

_PATIENCE = 5.0  # seconds that workers get to end by themselves
_START: tuple[str, tuple[Any, ...]] = ("start", ())  # what workers do before they take commands
_HARMLESS = ("call", "get", "has", "set", "wrapped")  # an error in one of these leaves the episodes as they are


class WorkerTraceback(Exception):
    """The traceback of an error in a worker, as text: the cause of the error that is raised here."""

    def __str__(self) -> str:
        """Return the text on lines of its own."""
        return f"\n{self.args[0]}"


class AnyEngine(Protocol):
    """What a vector needs of whoever steps its environments; see :class:`Engine`."""

    @property
    def signature(self) -> Signature:
        """What each of the environments is like."""

    @property
    def memory(self) -> Memory:
        """What the environments read and write."""

    @property
    def pending(self) -> bool:
        """Whether a command has not been answered yet."""

    def send(self, command: str, *arguments: Any) -> None:
        """Let the environments begin with a command."""

    def receive(self) -> list[Any]:
        """Return an answer of each environment, in their order; not to a reset or a step."""

    def parts(self) -> Iterator[PartialAnswer]:
        """Yield the answers to a reset or a step, as environments are ready."""

    def close(self) -> None:
        """Close the environments."""


class Engine(Uncopied):
    """Environments in shares: the first one lives in this process, each other one in a worker.

    They take one command at a time, a method of :class:`Batch`, and answer it together.
    """

    _instead = "make another vector of environments"

    def __init__(self, make: MakeEnv, count: int, processes: int, autoreset: AutoresetMode):
        """Start workers and wait until all environments are made.

        Args:
            make: makes an environment; sent to the workers by cloudpickle.
            count: number of environments.
            processes: number of processes with this one, at most ``count``.
            autoreset: when an environment whose episode is over is reset.

        Raises:
            OptionError: the environment holds what cannot be sent to workers.
            WorkerError: a worker died.
        """
        self._shares = shares(count, processes)
        sent = Sent(pickled(make, "the environment")) if len(self._shares) > 1 else None
        self._commands: list[Connection] = []
        self._answers: list[Connection] = []
        self._processes: list[BaseProcess] = []
        self._watch, self._workers = poll(), dict[int, int]()  # file descriptor of a worker's answers -> its number
        stack = ExitStack()
        self._close = weakref.finalize(self, stack.close)
        stack.callback(_stop, self._commands, self._answers, self._processes)
        self._command: tuple[str, tuple[Any, ...]] | None = _START
        try:
            for share in self._shares[1:]:
                self._start(share, sent, autoreset)
            self._batch = Batch(make, self._shares[0], autoreset)  # while the workers make theirs
            stack.callback(self._batch.close)
            check_alike(self.receive())
            self._share_memory(count)
        except BaseException:
            self.close()
            raise

    def _start(self, share: range, make: Sent | None, autoreset: AutoresetMode) -> None:
        # Forked children would share PyBullet's clients; spawned ones have their own.
        context = get_context("spawn")
        # Two pipes of one direction: quicker than one of both, which is a socket.
        commands, to_worker = context.Pipe(duplex=False)
        from_worker, answers = context.Pipe(duplex=False)
        self._commands.append(to_worker)
        self._answers.append(from_worker)
        self._watch.register(from_worker.fileno(), POLLIN)
        self._workers[from_worker.fileno()] = len(self._processes)
        with commands, answers:  # the worker has its own copies of these ends
            process = context.Process(target=serve, args=(commands, answers, make, share, autoreset), daemon=True)
            with unheard():
                process.start()
        self._processes.append(process)

    def _share_memory(self, count: int) -> None:
        """Map a file here and in the workers; it loses its name at once and goes with the last of them."""
        if not self._processes:
            self._batch.share(Memory(self.signature, count))
            return
        with shared_file(Memory.layout(self.signature, count).itemsize) as file:
            self.send("share_file", file.name, count)
            self.receive()

    @property
    def signature(self) -> Signature:
        """What each of the environments is like."""
        return self._batch.signature

    @property
    def memory(self) -> Memory:
        """What the environments read and write."""
        return self._batch.memory

    @property
    def pending(self) -> bool:
        """Whether a command has not been answered yet."""
        return self._command is not None

    def send(self, command: str, *arguments: Any) -> None:
        """Let the workers begin with a command; this process carries out its part in ``receive``."""
        self._require_open()
        if self.pending:
            raise AlreadyPendingCallError("the answer to the last command has not been waited for", "send")
        message = pickle.dumps((command, arguments), pickle.HIGHEST_PROTOCOL) if self._processes else b""
        self._command = command, arguments
        for worker in range(len(self._commands)):
            self._post(worker, message)

    def _require_open(self) -> None:
        if not self._close.alive:
            raise ClosedEnvironmentError("the vector environment is closed, by close() or by an error; make a new one")

    def _post(self, worker: int, message: bytes) -> None:
        """Send a pickled command to a worker."""
        try:
            self._commands[worker].send_bytes(message)
        except ConnectionError as error:
            raise self._death(worker) from error
        except BaseException:  # an interrupt: nobody knows which workers have begun
            self.close()
            raise

    def receive(self) -> list[Any]:
        """Carry out the command and wait for the workers; return an answer of each environment, in their order.

        Raises:
            WorkerError: a worker died; the others have been stopped.
            Exception: what went wrong in an environment; unless it was an attribute, all have been closed.
        """
        command, arguments = self._begun()
        try:
            answers = [self._own(command, arguments), *map(self._answer, range(len(self._answers)))]
        except BaseException:  # an interrupt too: nobody knows how much of the answers has been read
            self.close()
            raise
        self._command = None
        return gathered(self._shares, answers, command, self.close)

    def parts(self) -> Iterator[PartialAnswer]:
        """Carry out a reset or a step; yield its answers as they come, so that the last leave little to be gathered.

        Raises:
            WorkerError: a worker died; the others have been stopped.
            Exception: what went wrong in an environment; all have been closed.
        """
        command, arguments = self._begun()
        left = sum(map(len, self._shares[1:]))
        try:
            yield from getattr(self._batch, command)(*arguments)
            while left:
                for worker in self._ready():
                    part = self._part(worker)
                    left -= len(part.numbers)
                    yield part
        except BaseException:  # an interrupt too, and whatever stops the caller halfway
            self.close()
            raise
        self._command = None

    def _begun(self) -> tuple[str, tuple[Any, ...]]:
        if self._command is None:
            raise NoAsyncCallError("there is no command to wait for", "receive")
        return self._command

    def _ready(self) -> list[int]:
        """Wait until workers have answered, and return their numbers."""
        return [self._workers[file] for file, _ in wait_for_message(self._watch)]

    def _part(self, worker: int) -> PartialAnswer:
        """Return a worker's next part of the answer to a reset or a step."""
        part = self._message(worker)
        if isinstance(part, Failure):
            raise _raised(part, self._shares[worker + 1])
        assert isinstance(part, PartialAnswer)
        return part

    def _own(self, command: str, arguments: tuple[Any, ...]) -> list[Any] | Failure:
        """Carry out this process's part of a command."""
        try:
            entries: list[Any] = getattr(self._batch, command)(*arguments)
            return entries
        except Exception as error:
            return Failure(error, "")

    def _answer(self, worker: int) -> list[Any] | Failure:
        """Return what a worker answers to a command that is neither a reset nor a step."""
        answer: list[Any] | Failure = self._message(worker)
        return answer

    def _message(self, worker: int) -> Any:
        """Return what a worker sends next."""
        try:
            return pickle.loads(listen(self._answers[worker]))
        except (EOFError, ConnectionError) as error:
            raise self._death(worker) from error

    def _death(self, worker: int) -> WorkerError:
        """Return the error of a worker that has died, and stop the others."""
        process, share, starting = self._processes[worker], self._shares[worker + 1], self._command is _START
        process.join(_PATIENCE)
        code = process.exitcode
        self.close()
        hint = "; -9 may mean: out of memory"
        if starting:
            hint = "; see its message above; a script must start workers under `if __name__ == '__main__':`"
        where = f"the worker of environments {share.start} to {share.stop - 1}"
        return WorkerError(f"{where} died (exit code {code}{hint}); all workers have been stopped")

    def close(self) -> None:
        """Close the environments and end the workers; closing twice is allowed."""
        self._close()


def gathered(
    shares: Sequence[range], answers: Sequence[list[Any] | Failure], command: str, close: Callable[[], None]
) -> list[Any]:
    """Return the answers of all environments, in their order.

    Args:
        shares: the numbers of the environments that each answer is of.
        answers: an entry for each of them, or what went wrong; its trace is empty if that was in this process.
        command: that they answer.
        close: closes all environments.

    Raises:
        Exception: what went wrong in an environment; unless it was an attribute, all have been closed.
    """
    entries: list[Any] = []
    for share, answer in zip(shares, answers, strict=True):
        if isinstance(answer, Failure):
            if command not in _HARMLESS:
                close()
            raise _raised(answer, share)
        entries += answer
    return entries


def _raised(failure: Failure, share: range) -> Exception:
    """Return the error of an environment; its cause is the trace, if it comes from a worker."""
    if failure.trace:
        trace = WorkerTraceback(f"in the worker of environments {list(share)}:\n{failure.trace}")
        failure.error.__cause__ = trace
    return failure.error


def _stop(commands: list[Connection], answers: list[Connection], processes: list[BaseProcess]) -> None:
    """End workers: one whose pipes are closed ends by itself, after the step that it is in."""
    for pipe in (*commands, *answers):
        pipe.close()
    deadline = time.monotonic() + _PATIENCE
    for process in processes:
        process.join(max(0.0, deadline - time.monotonic()))
        if process.is_alive():
            process.kill()
            process.join()


def shares(count: int, processes: int) -> list[range]:
    """Return the numbers of the environments of each process.

    The first process has somewhat fewer than the others: it also gathers what all of them answer.
    """
    spared = count // (16 * processes) if processes > 1 else 0
    own = count // processes - spared
    others = processes - 1
    bounds = [0, *(own + (count - own) * process // max(others, 1) for process in range(processes))]
    return [range(low, high) for low, high in pairwise(bounds)]


def start(make: MakeEnv, count: int, workers: int | None, autoreset: AutoresetMode) -> Engine:
    """Make environments in this process (workers 0 or 1) or in some, this one included (None: one for each core)."""
    return Engine(make, count, processes_of(count, workers), autoreset)


def processes_of(count: int, workers: int | None) -> int:
    """Return how many processes the option ``workers`` means for a number of environments."""
    return min(max((os.cpu_count() or 1) if workers is None else workers, 1), count)
