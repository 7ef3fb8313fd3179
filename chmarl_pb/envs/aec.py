"""The AEC view: the robots act one after the other, the world moves after the second."""

from typing import Any

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

    def step(self, action: int | None) -> None:
        """Note the action of the robot whose turn it is; after the second, let both act.

        Raises:
            ActionError: it is not a whole number, or out of range.
        """
        robot = self.agent_selection
        if not (self.terminations[robot] or self.truncations[robot]):
            self.unwrapped.action_name(robot, action)
        super().step(action)


class OrderedTurnEnv(OrderEnforcingWrapper):  # type: ignore[misc]
    """PettingZoo's check of the order of calls, which a copy begins anew."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Let copies and pickles be made anew, see :meth:`HouseholdEnv.__reduce__`."""
        return type(self), (self.env,)


def aec_env(observation: Observed = "scene_graph", **options: Any) -> AECEnv:
    """Return the AEC view of a new core environment, which is its ``unwrapped``; see :class:`HouseholdEnv`."""
    return OrderedTurnEnv(TurnEnv(HouseholdEnv(observation, **options)))
