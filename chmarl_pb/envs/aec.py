"""The AEC view: the robots act one after the other, the world moves after the second."""

from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils.conversions import parallel_to_aec_wrapper
from pettingzoo.utils.wrappers import OrderEnforcingWrapper

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.world import World


class AecView(parallel_to_aec_wrapper):
    """The core environment in PettingZoo's turn-taking form.

    Attributes:
        parallel: the core environment.
    """

    def __init__(self, parallel: HouseholdEnv):
        """Wrap a core environment."""
        super().__init__(parallel)
        self.parallel = parallel

    @property
    def unwrapped(self) -> "AecView":
        """The view itself."""
        return self

    @property
    def world(self) -> World:
        """The world of the home that the present episode is played in."""
        return self.parallel.world


def aec_env(observation: str = "scene_graph", **options: Any) -> AECEnv:
    """Return the AEC view of a new core environment; see :class:`HouseholdEnv` for the options."""
    return OrderEnforcingWrapper(AecView(HouseholdEnv(observation, **options)))
