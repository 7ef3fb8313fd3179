"""Infos that hold numbers only, for libraries that put them into tensors."""

from typing import Any

import numpy as np
from pettingzoo.utils import BaseParallelWrapper

from chmarl_pb.envs.parallel import Results

Infos = dict[str, dict[str, Any]]


class NumericInfos(BaseParallelWrapper):  # type: ignore[misc]
    """A ParallelEnv whose infos have no text, as TorchRL's ``PettingZooWrapper`` wants them.

    ``action_mask``, ``action_success``, ``success`` and ``potential`` stay; instruction, feedback, names in view and
    the task's id go. Only the infos change.

    >>> env = chmarl_pb.NumericInfos(chmarl_pb.parallel_env(split="val-unseen"))
    >>> observations, infos = env.reset(seed=0)
    >>> sorted(infos["drone"])
    ['action_mask', 'action_success', 'potential', 'success']
    >>> env.close()
    """

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[dict[str, Any], Infos]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return observations, _numbers(infos)

    def step(self, actions: dict[str, Any]) -> Results:
        """Let all robots act once; see :meth:`HouseholdEnv.step`."""
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        return observations, rewards, terminations, truncations, _numbers(infos)


def _numbers(infos: Infos) -> Infos:
    return {robot: {key: value for key, value in info.items() if _is_number(value)} for robot, info in infos.items()}


def _is_number(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        return value.dtype.kind in "biuf"
    return isinstance(value, (bool, int, float, np.number, np.bool_))
