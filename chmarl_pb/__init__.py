"""Cooperative, heterogeneous multi-robot reinforcement learning in homes, on PyBullet.

import gymnasium as gym, chmarl_pb
gym.make("CHMARL/SceneGraph-v0")
chmarl_pb.parallel_env(observation="visual", split="val-unseen")
"""

from contextlib import nullcontext
from importlib import import_module
from typing import TYPE_CHECKING, Any

from chmarl_pb.signals import is_program, loading

with loading("chmarl-pb") if is_program("chmarl_pb") else nullcontext():
    from chmarl_pb.envs.registration import register_envs

if TYPE_CHECKING:
    from chmarl_pb.envs.flat import flat_env as flat_env
    from chmarl_pb.envs.flat_vector import FlatObservation as FlatObservation
    from chmarl_pb.envs.numeric_infos import NumericInfos as NumericInfos
    from chmarl_pb.envs.options import Observed
    from chmarl_pb.envs.parallel import HouseholdEnv as HouseholdEnv
    from chmarl_pb.envs.rollout import Episode as Episode
    from chmarl_pb.envs.rollout import rollout as rollout
    from chmarl_pb.envs.vector.env import vector_env as vector_env
    from chmarl_pb.errors import ChmarlError as ChmarlError
    from chmarl_pb.evaluation.audit import audit as audit
    from chmarl_pb.evaluation.protocol import evaluate as evaluate
    from chmarl_pb.evaluation.result import Report as Report
    from chmarl_pb.homes.generate.store import generate_home as generate_home
    from chmarl_pb.learning.sb3.vec_env import sb3_vec_env as sb3_vec_env
    from chmarl_pb.policies.registry import make_policy as make_policy
    from chmarl_pb.policies.sources import load_policy as load_policy
    from chmarl_pb.tasks.splits import load_tasks as load_tasks
    from chmarl_pb.tasks.task import Task as Task

__version__ = "0.3.0"

#: Public name -> module that defines it; loaded at first use, so that importing the package is quick.
_PUBLIC = {
    "ChmarlError": "chmarl_pb.errors",
    "Episode": "chmarl_pb.envs.rollout",
    "FlatObservation": "chmarl_pb.envs.flat_vector",
    "HouseholdEnv": "chmarl_pb.envs.parallel",
    "NumericInfos": "chmarl_pb.envs.numeric_infos",
    "Report": "chmarl_pb.evaluation.result",
    "Task": "chmarl_pb.tasks.task",
    "audit": "chmarl_pb.evaluation.audit",
    "evaluate": "chmarl_pb.evaluation.protocol",
    "flat_env": "chmarl_pb.envs.flat",
    "generate_home": "chmarl_pb.homes.generate.store",
    "load_policy": "chmarl_pb.policies.sources",
    "load_tasks": "chmarl_pb.tasks.splits",
    "make_policy": "chmarl_pb.policies.registry",
    "rollout": "chmarl_pb.envs.rollout",
    "sb3_vec_env": "chmarl_pb.learning.sb3.vec_env",
    "vector_env": "chmarl_pb.envs.vector.env",
}
_NEEDS_EXTRA = {"sb3_vec_env"}  # left out of ``import *``, which would fail without it
__all__ = ["__version__", "env", "parallel_env", *(name for name in _PUBLIC if name not in _NEEDS_EXTRA)]


# Gymnasium 1.0 stopped reading the ``gymnasium.envs`` entry point, so importing the package registers
# the ids; ``gym.make("chmarl_pb:CHMARL/SceneGraph-v0")`` does the import by itself.
register_envs()


def parallel_env(observation: "Observed" = "scene_graph", **options: Any) -> "HouseholdEnv":
    """Return the PettingZoo ParallelEnv of some robots, by default the agents "humanoid" and "drone".

    Args:
        observation: "scene_graph", "visual", "depth", "segmentation", "text", a sensor, or a tuple of them.
        **options: track, split, home, task, robots, messages, feedback, max_steps, image_size, execution, render_mode,
            goal, pointing, renderer, catalog, lookalikes, templates; see :class:`chmarl_pb.envs.options.Options`.

    Raises:
        OptionError: an option has a value that it does not know.
        HomeError: a home cannot be used.
    """
    from chmarl_pb.envs.parallel import HouseholdEnv

    return HouseholdEnv(observation, **options)


def env(observation: "Observed" = "scene_graph", **options: Any) -> Any:
    """Return the same environment as PettingZoo AEC: the robots act one after the other; see :func:`parallel_env`."""
    from chmarl_pb.envs.aec import aec_env

    return aec_env(observation, **options)


def __getattr__(name: str) -> Any:
    if name in _PUBLIC:
        return getattr(import_module(_PUBLIC[name]), name)
    raise AttributeError(f"module 'chmarl_pb' has no attribute {name!r}")
