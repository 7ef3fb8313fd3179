"""Environments that do not wait for each other: each is stepped once its action is there and its process is free."""

import pickle
from collections import deque
from collections.abc import Iterator, Sequence
from select import POLLIN, POLLOUT, poll
from typing import Any

import numpy as np
from gymnasium.error import NoAsyncCallError
from gymnasium.vector import AutoresetMode

from chmarl_pb.envs.vector.batch import MakeEnv, PartialAnswer
from chmarl_pb.envs.vector.engine import Engine
from chmarl_pb.envs.vector.infos import Change
from chmarl_pb.envs.vector.worker import Failure

_MOST = 256  # environments in a message, which then fits a pipe that can be written to


class Pool(Engine):
    """Environments that take resets and steps one by one and answer in the order in which they are ready.

    What a worker has to do waits in its pipe, so that it goes on while earlier answers are read. The environments
    of this process are stepped while fewer answers are there than are asked for. Commands for all of them (``send``,
    ``receive``) come after what has been begun before.
    """

    def __init__(self, make: MakeEnv, count: int, processes: int, autoreset: AutoresetMode):
        """Start workers and wait until all environments are made; see :class:`Engine`."""
        self._ready_answers: deque[tuple[int, Change]] = deque()
        self._own_work: deque[tuple[str, int, tuple[Any, ...], int]] = deque()  # the last: answers taken before
        self._taken, self._count = 0, count
        self._under_way = np.zeros(count, np.bool_)
        super().__init__(make, count, processes, autoreset)

    @property
    def under_way(self) -> np.ndarray:
        """Which environments have begun something whose answer has not been taken; (count,) bool."""
        return self._under_way

    def begin(self, command: str, numbers: Sequence[int], *arguments: Any) -> None:
        """Let environments, none of which is under way, begin with a reset or a step.

        Raises:
            ClosedEnvironmentError: the environments have been closed.
            WorkerError: a worker died; the others have been stopped.
        """
        self._require_open()
        self._under_way[numbers] = True
        for worker, share in enumerate(self._shares[1:]):
            theirs = [number for number in numbers if number in share]
            for first in range(0, len(theirs), _MOST):
                message = (command, (*arguments, theirs[first : first + _MOST]))
                self._post(worker, pickle.dumps(message, pickle.HIGHEST_PROTOCOL))
        own = self._shares[0]
        self._own_work.extend((command, number, arguments, self._taken) for number in numbers if number in own)

    def take(self, count: int) -> tuple[list[int], list[Change]]:
        """Return the numbers of the first environments that are ready, in their order, and how their infos changed.

        Of those in this process one is taken at the latest when as many others have been as there are environments.

        Raises:
            ClosedEnvironmentError: the environments have been closed.
            NoAsyncCallError: fewer are under way.
            WorkerError: a worker died; the others have been stopped.
            Exception: what went wrong in an environment; all have been closed.
        """
        self._require_open()
        if (begun := np.count_nonzero(self._under_way)) < count:
            raise NoAsyncCallError(f"{begun} environments are under way, fewer than {count}", "recv")
        try:
            self._collect(wait=False)
            while len(self._ready_answers) < count or self._is_late():
                if self._own_work:
                    self._do_own()
                self._collect(wait=len(self._ready_answers) < count and not self._own_work)
        except BaseException:  # an interrupt too: nobody knows what has been stepped
            self.close()
            raise
        taken = sorted((self._ready_answers.popleft() for _ in range(count)), key=lambda answer: answer[0])
        self._taken += count
        numbers = [number for number, _ in taken]
        self._under_way[numbers] = False
        return numbers, [change for _, change in taken]

    def _is_late(self) -> bool:
        """Return whether an environment of this process has waited so long that it comes first."""
        return bool(self._own_work) and self._taken - self._own_work[0][-1] >= self._count

    def _do_own(self) -> None:
        """Let the environment of this process that has waited longest reset or step."""
        command, number, arguments, _ = self._own_work.popleft()
        for part in getattr(self._batch, command)(*arguments, [number]):
            self._keep(part)

    def _collect(self, wait: bool) -> None:
        """Read what workers have sent; or wait until one of them has."""
        for worker in self._ready() if wait else self._ready_now():
            self._keep(self._part(worker))

    def _ready_now(self) -> Iterator[int]:
        """Yield workers that have answered, until there is nothing more to read."""
        while found := self._watch.poll(0):
            yield from (self._workers[file] for file, _ in found)

    def _keep(self, part: PartialAnswer) -> None:
        self._ready_answers.extend(zip(part.numbers, part.changes, strict=True))

    def _post(self, worker: int, message: bytes) -> None:
        """Send a command to a worker; read answers as long as it has no room, as it may wait for room for them."""
        watch = poll()
        watch.register(self._commands[worker].fileno(), POLLOUT)
        watch.register(self._answers[worker].fileno(), POLLIN)
        while all(file != self._commands[worker].fileno() for file, _ in watch.poll()):
            self._keep(self._part(worker))
        super()._post(worker, message)

    def close(self) -> None:
        """Close the environments and end the workers; nothing is under way any more."""
        self._under_way[:] = False
        super().close()

    def receive(self) -> list[Any]:
        """Finish what has been begun, carry out the command, and return an answer of each environment."""
        try:
            while self._own_work:
                self._do_own()
        except BaseException:
            self.close()
            raise
        return super().receive()

    def _answer(self, worker: int) -> list[Any] | Failure:
        """Return what a worker answers to the command; keep what it had to answer before."""
        while True:
            answer: list[Any] | PartialAnswer | Failure = self._message(worker)
            if not isinstance(answer, PartialAnswer):
                return answer
            self._keep(answer)
