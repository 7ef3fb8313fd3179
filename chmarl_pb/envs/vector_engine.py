"""Where the environments of a vector live: in this process, or in workers with memory that all share."""

import mmap
import os
import pickle
import tempfile
import time
import weakref
from itertools import pairwise
from multiprocessing import get_context
from multiprocessing.connection import Connection
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Protocol

from gymnasium.error import AlreadyPendingCallError, ClosedEnvironmentError, NoAsyncCallError
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import CloudpickleWrapper

from chmarl_pb.envs.vector_worker import Batch, Failure, MakeEnv, Memory, Signature, serve
from chmarl_pb.errors import ChmarlError

_PATIENCE = 5.0  # seconds that workers get to end by themselves
_HARMLESS = ("call", "get", "has", "set", "wrapped")  # an error in one of these leaves the episodes as they are


class WorkerError(ChmarlError, RuntimeError):
    """A worker process of a vector environment died."""


class WorkerTraceback(Exception):
    """The traceback of an error in a worker, as text: the cause of the error that is raised here."""

    def __str__(self) -> str:
        """Return the text on lines of its own."""
        return f"\n{self.args[0]}"


class Engine(Protocol):
    """Environments that take one command at a time, a method of :class:`Batch`, and answer it together."""

    signature: Signature
    memory: Memory

    @property
    def pending(self) -> bool:
        """Whether a command has not been answered yet."""

    def send(self, command: str, *arguments: Any) -> None:
        """Give a command to all environments."""

    def receive(self) -> list[Any]:
        """Wait for the answers, one of each environment that the command is for, in their order."""

    def close(self) -> None:
        """Close the environments; closing twice is allowed."""


class InProcess:
    """Environments in this process."""

    def __init__(self, make: MakeEnv, count: int, autoreset: AutoresetMode):
        """Make environments; see :class:`Batch`."""
        batch = Batch(make, range(count), autoreset)
        self._close = weakref.finalize(self, batch.close)
        self._batch, self.signature = batch, batch.signature
        self.memory = Memory(batch.signature, count)
        batch.share(self.memory)
        self._command: tuple[str, tuple[Any, ...]] | None = None

    @property
    def pending(self) -> bool:
        """Whether a command has not been answered yet."""
        return self._command is not None

    def send(self, command: str, *arguments: Any) -> None:
        """Remember a command; it is carried out by ``receive``."""
        _check_ready(self._close.alive, self.pending)
        self._command = command, arguments

    def receive(self) -> list[Any]:
        """Carry the command out."""
        if self._command is None:
            raise NoAsyncCallError("there is no command to wait for", "receive")
        (command, arguments), self._command = self._command, None
        try:
            return getattr(self._batch, command)(*arguments)
        except BaseException:
            if command not in _HARMLESS:
                self.close()
            raise

    def close(self) -> None:
        """Close the environments."""
        self._close()


class InWorkers:
    """Environments in worker processes, in equal shares."""

    def __init__(self, make: MakeEnv, count: int, workers: int, autoreset: AutoresetMode):
        """Start workers and wait until all environments are made.

        Args:
            make: makes an environment; sent to the workers by cloudpickle.
            count: number of environments.
            workers: number of processes, at most ``count``.
            autoreset: when an environment whose episode is over is reset.

        Raises:
            WorkerError: a worker died.
        """
        bounds = [count * worker // workers for worker in range(workers + 1)]
        self._shares = [range(low, high) for low, high in pairwise(bounds)]
        self._commands: list[Connection] = []
        self._answers: list[Connection] = []
        self._processes: list[BaseProcess] = []
        self._close = weakref.finalize(self, _stop, self._commands, self._answers, self._processes)
        self._command: str | None = "start"
        try:
            for share in self._shares:
                self._start(share, CloudpickleWrapper(make), autoreset)
            self.signature: Signature = self.receive()[0]
            self._share_memory(count)
        except BaseException:
            self.close()
            raise

    def _start(self, share: range, make: CloudpickleWrapper, autoreset: AutoresetMode) -> None:
        # Forked children would share PyBullet's clients; spawned ones have their own.
        context = get_context("spawn")
        # Two pipes of one direction: quicker than one of both, which is a socket.
        commands, to_worker = context.Pipe(duplex=False)
        from_worker, answers = context.Pipe(duplex=False)
        self._commands.append(to_worker)
        self._answers.append(from_worker)
        with commands, answers:  # the worker has its own copies of these ends
            process = context.Process(target=serve, args=(commands, answers, make, share, autoreset), daemon=True)
            process.start()
        self._processes.append(process)

    def _share_memory(self, count: int) -> None:
        """Map a file here and in the workers; it loses its name at once and goes with the last of them."""
        shm = Path("/dev/shm")
        with tempfile.NamedTemporaryFile(prefix="chmarl-pb-", dir=shm if shm.is_dir() else None) as file:
            file.truncate(Memory.layout(self.signature, count).itemsize)
            self.memory = Memory(self.signature, count, mmap.mmap(file.fileno(), 0))
            self.send("share_file", file.name, count)
            self.receive()

    @property
    def pending(self) -> bool:
        """Whether a command has not been answered yet."""
        return self._command is not None

    def send(self, command: str, *arguments: Any) -> None:
        """Let the workers begin with a command."""
        _check_ready(self._close.alive, self.pending)
        message = pickle.dumps((command, arguments), pickle.HIGHEST_PROTOCOL)
        self._command = command
        for worker, pipe in enumerate(self._commands):
            try:
                pipe.send_bytes(message)
            except ConnectionError as error:
                raise self._death(worker) from error
            except BaseException:  # an interrupt: nobody knows which workers have begun
                self.close()
                raise

    def receive(self) -> list[Any]:
        """Wait for the answers of the workers.

        Raises:
            WorkerError: a worker died; the others have been stopped.
            Exception: what went wrong in an environment; unless it was an attribute, all workers have been stopped.
        """
        if self._command is None:
            raise NoAsyncCallError("there is no command to wait for", "receive")
        try:
            answers = [self._answer(worker) for worker in range(len(self._answers))]
        except BaseException:  # an interrupt too: nobody knows how much of the answers has been read
            self.close()
            raise
        command, self._command = self._command, None
        for share, answer in zip(self._shares, answers, strict=True):
            if isinstance(answer, Failure):
                if command not in _HARMLESS:
                    self.close()
                raise answer.error from WorkerTraceback(f"in the worker of environments {list(share)}:\n{answer.trace}")
        return [entry for answer in answers for entry in answer]

    def _answer(self, worker: int) -> Any:
        try:
            return pickle.loads(self._answers[worker].recv_bytes())
        except (EOFError, ConnectionError) as error:
            raise self._death(worker) from error

    def _death(self, worker: int) -> WorkerError:
        """Return the error of a worker that has died, and stop the others."""
        process, share, starting = self._processes[worker], self._shares[worker], self._command == "start"
        process.join(_PATIENCE)
        code = process.exitcode
        self.close()
        mend = "; -9 may mean: out of memory"
        if starting:
            mend = "; see its message above; a script must start workers under `if __name__ == '__main__':`"
        where = f"the worker of environments {share.start} to {share.stop - 1}"
        return WorkerError(f"{where} died (exit code {code}{mend}); all workers have been stopped")

    def close(self) -> None:
        """End the workers."""
        self._close()


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


def _check_ready(alive: bool, pending: bool) -> None:
    if not alive:
        raise ClosedEnvironmentError("the vector environment is closed, by close() or by an error; make a new one")
    if pending:
        raise AlreadyPendingCallError("the answer to the last command has not been waited for", "send")


def start(make: MakeEnv, count: int, workers: int | None, autoreset: AutoresetMode) -> Engine:
    """Make environments in this process (workers 0 or 1) or in others (None: one for each core)."""
    wanted = (os.cpu_count() or 1) if workers is None else workers
    if min(wanted, count) <= 1:
        return InProcess(make, count, autoreset)
    return InWorkers(make, count, min(wanted, count), autoreset)
