"""A share of a vector's environments on another machine: what its actor does, without Ray."""

from collections.abc import Iterable
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import CloudpickleWrapper

from chmarl_pb.envs.vector.batch import Batch, PartialAnswer
from chmarl_pb.envs.vector.infos import Change
from chmarl_pb.envs.vector.memory import Memory, Signature, Spaces
from chmarl_pb.envs.vector.worker import IN_PARTS, Failure, failure


class Share:
    """Some environments of a vector, whose answers hold all that they have written: there is no shared memory."""

    def __init__(self, make: CloudpickleWrapper, numbers: range, count: int, autoreset: AutoresetMode):
        """Make environments of a vector of ``count``; see :class:`Batch`."""
        self._batch, self._rows = Batch(make.fn, numbers, autoreset), slice(numbers.start, numbers.stop)
        self._batch.share(Memory(self._batch.signature, count))

    def signature(self) -> Signature:
        """Return what each of the environments is like."""
        return self._batch.signature

    def spaces(self) -> list[Spaces]:
        """Return the spaces of the environments."""
        return self._batch.start()

    def do(
        self, command: str, arguments: tuple[Any, ...], actions: np.ndarray
    ) -> tuple[list[Any] | Failure, list[np.ndarray]]:
        """Carry out a command; return an answer of each environment, and what they have written."""
        memory = self._batch.memory
        memory.actions[self._rows] = actions
        try:
            answer = getattr(self._batch, command)(*arguments)
            if command in IN_PARTS:
                return _changes(answer), [array[self._rows] for array in written(memory)]
        except Exception as error:
            return failure(error), []
        return answer, []


def written(memory: Memory) -> list[np.ndarray]:
    """Return what environments write: observations, rewards and ends."""
    return [*memory.observations.values(), memory.rewards, memory.terminated, memory.truncated]


def _changes(parts: Iterable[PartialAnswer]) -> list[Change]:
    """Return the changes of all environments, in their order."""
    changes = {number: change for part in parts for number, change in zip(part.numbers, part.changes, strict=True)}
    return [changes[number] for number in sorted(changes)]
