"""Many environments of which some are always at work: whoever is ready first is answered first, as EnvPool has it."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium.error import AlreadyPendingCallError
from gymnasium.vector import AutoresetMode

from chmarl_pb.envs.vector.asking import Asking
from chmarl_pb.envs.vector.exchange import Seeds, Step, seed_of_each, write_actions
from chmarl_pb.envs.vector.pool import Pool
from chmarl_pb.errors import OptionError
from chmarl_pb.world import Uncopied


class HouseholdAsyncEnv(Uncopied, Asking):
    """Environments of one kind that do not wait for each other; see :func:`chmarl_pb.vector_env`.

    ``recv()`` returns those ``batch_size`` environments that are ready first, ``send(actions, env_id)`` lets some go
    on. Which come together depends on the machine; what an environment answers does not: by the same seed and actions
    each plays the same episodes as in any other vector.

    >>> envs = chmarl_pb.vector_env(4, workers=1, batch_size=2, split="val-unseen")
    >>> envs.async_reset(seed=0)
    >>> for _ in range(3):
    ...     observations, rewards, terminated, truncated, infos = envs.recv()
    ...     envs.send(np.zeros((2, 2), int), infos["env_id"])
    >>> observations["humanoid_messages"].shape
    (2, 2, 4)
    >>> envs.close()

    Attributes:
        num_envs: number of environments.
        batch_size: how many of them ``recv`` returns.
        single_observation_space: of one environment.
        single_action_space: of one environment.
        observation_space: of a batch.
        action_space: of a batch.
        metadata: of the environments, with ``autoreset_mode``.
        render_mode: of the environments.
    """

    _instead = "make another by vector_env(...)"

    def __init__(self, pool: Pool, count: int, batch_size: int, autoreset: AutoresetMode):
        """Join the environments of a pool, which is closed with this.

        Args:
            pool: where they live.
            count: their number.
            batch_size: how many of them ``recv`` returns.
            autoreset: when one whose episode is over is reset.
        """
        self._describe(pool, count, batch_size, autoreset)
        self._pool, self.batch_size = pool, batch_size

    def async_reset(self, seed: Seeds = None, options: dict[str, Any] | None = None) -> None:
        """Let all environments begin with a reset; ``recv`` returns what they observe, with a reward of 0.

        Args:
            seed: of the first one, the next have the next numbers; or one for each.
            options: of each reset, as :meth:`chmarl_pb.envs.parallel.HouseholdEnv.reset` has them.

        Raises:
            AlreadyPendingCallError: an environment has not been received yet.
            OptionError: the seeds do not fit the environments.
        """
        seeds = seed_of_each(seed, self.num_envs)
        if self._pool.under_way.any():
            raise AlreadyPendingCallError("environments are under way; receive them before a reset", "async_reset")
        self._pool.begin("reset", range(self.num_envs), seeds, [options or None] * self.num_envs, None)

    def send(self, actions: Any, env_id: Sequence[int] | np.ndarray) -> None:
        """Let environments begin with a step.

        Args:
            actions: one for each of them, (k, ...).
            env_id: their numbers, (k,), as ``infos["env_id"]`` has them; each has been received since it was last sent.

        Raises:
            OptionError: the numbers are not of different environments.
            AlreadyPendingCallError: one of them has not been received yet.
            ActionError: the actions are not an array of the action space's shape and kind.
        """
        numbers = self._checked(env_id)
        if self._pool.under_way[numbers].any():
            raise AlreadyPendingCallError(f"some of the environments {numbers.tolist()} are under way", "send")
        write_actions(self._pool, actions, numbers)
        self._pool.begin("step", numbers.tolist())

    def recv(self) -> Step:
        """Return what came of the first ``batch_size`` environments that are ready, in the order of their numbers.

        Returns:
            Observations, rewards, ends and infos as those of a vector of these environments alone, each (batch_size,
            ...); ``infos["env_id"]`` has their numbers.

        Raises:
            NoAsyncCallError: fewer are under way.
        """
        numbers, changes = self._pool.take(self.batch_size)
        self._table.update(changes, numbers)
        rows, memory = np.array(numbers), self._pool.memory
        arrays = {key: array[rows] for key, array in memory.observations.items()}
        infos = {**self._table.infos(rows), "env_id": rows}
        return self._as_observed(arrays), memory.rewards[rows], memory.terminated[rows], memory.truncated[rows], infos

    def step(self, actions: Any, env_id: Sequence[int] | np.ndarray) -> Step:
        """Send actions, and return what :meth:`recv` does: perhaps of other environments."""
        self.send(actions, env_id)
        return self.recv()

    def close(self) -> None:
        """Close the environments and end the workers; closing twice is allowed."""
        self._pool.close()

    def _checked(self, env_id: Sequence[int] | np.ndarray) -> np.ndarray:
        """Return the numbers of different environments as an array."""
        numbers = np.asarray(env_id)
        valid = numbers.ndim == 1 and numbers.dtype.kind in "iu" and len(numbers) > 0
        if (
            not valid
            or not ((numbers >= 0) & (numbers < self.num_envs)).all()
            or len(set(numbers.tolist())) < len(numbers)
        ):
            raise OptionError(f"env_id={env_id!r} are not different numbers from 0 to {self.num_envs - 1}")
        return numbers
