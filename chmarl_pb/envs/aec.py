"""The AEC view: the robots act one after the other, the world moves after the second."""

from typing import Any

from pettingzoo import AECEnv
from pettingzoo.utils import parallel_to_aec

from chmarl_pb.envs.parallel import HouseholdEnv


def aec_env(observation: str = "scene_graph", **options: Any) -> AECEnv:
    """Return the AEC view of a new core environment, which is its ``unwrapped``; see :class:`HouseholdEnv`."""
    return parallel_to_aec(HouseholdEnv(observation, **options))
