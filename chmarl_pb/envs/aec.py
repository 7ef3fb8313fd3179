"""The AEC view: the robots act one after the other, the world moves after the last."""

from typing import Any

import numpy as np
from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from chmarl_pb.envs.options import Observed
from chmarl_pb.envs.parallel import HouseholdEnv


class TurnEnv(parallel_to_aec_wrapper):  # type: ignore[misc]
    """PettingZoo's view, but a wrong action is refused at its own turn, and another can be given.

    >>> env = chmarl_pb.env(split="val-unseen")
    >>> env.reset(seed=0)
    >>> for robot in env.agent_iter(max_iter=4):
    ...     env.step(env.action_space(robot).n - 1)
    >>> env.unwrapped.steps
    2
    >>> env.close()
    """

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, without the turns of the present episode."""
        return type(self), (self.env,)

    infos: dict[str, dict[str, Any]]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> None:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        super().reset(seed, options)
        self._fit_masks()

    def _fit_masks(self) -> None:
        """Make masks fit the spaces of robots with own words, actions and symbols, for PettingZoo's agents."""
        if self.unwrapped.symbols:
            symbols = np.ones(self.unwrapped.symbols, np.int8)
            self.infos = {
                robot: {**info, "action_mask": (info["action_mask"], symbols)} for robot, info in self.infos.items()
            }

    def step(self, action: int | None) -> None:
        """Note the action of the robot whose turn it is; after the last, let all act.

        Raises:
            ActionError: it is not a whole number, or out of range.
        """
        robot = self.agent_selection
        if not (self.terminations[robot] or self.truncations[robot]):
            self.unwrapped.action_name(robot, action)
        infos = self.infos
        super().step(action)
        if self.infos is not infos:  # the world has moved
            self._fit_masks()


class OrderedTurnEnv(OrderEnforcingWrapper):  # type: ignore[misc]
    """PettingZoo's check of the order of calls, which a copy begins anew."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, see :meth:`HouseholdEnv.__reduce__`."""
        return type(self), (self.env,)


def aec_env(observation: Observed = "scene_graph", **options: Any) -> AECEnv:
    """Return the AEC view of a new core environment, which is its ``unwrapped``; see :class:`HouseholdEnv`."""
    return OrderedTurnEnv(TurnEnv(HouseholdEnv(observation, **options)))
