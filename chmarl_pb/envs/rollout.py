"""The one loop: a policy drives an environment through an episode."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from chmarl_pb.envs.parallel import AGENTS, HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.planner.blind import BlindPolicy
from chmarl_pb.planner.cooperative import CooperativePlanner
from chmarl_pb.planner.instruction_blind import InstructionBlindPolicy
from chmarl_pb.planner.open_loop import OpenLoopPolicy
from chmarl_pb.planner.policy import Infos, Observations, Policy, RandomPolicy
from chmarl_pb.planner.reactive import ReactivePolicy
from chmarl_pb.planner.search import SearchPolicy
from chmarl_pb.tasks.task import Task


@dataclass(frozen=True, eq=False)
class Episode:
    """One played episode; T is its number of joint steps.

    Attributes:
        task: the task.
        observations: T + 1 times robot -> observation.
        actions: T times robot -> number of its action.
        rewards: (T,) shared rewards.
        infos: T + 1 times robot -> info.
        success: whether X stands on Y.
    """

    task: Task
    observations: tuple[Observations, ...]
    actions: tuple[dict[str, int], ...]
    rewards: np.ndarray
    infos: tuple[Infos, ...]
    success: bool

    def __len__(self) -> int:
        """Return the number of joint steps."""
        return len(self.actions)


class PlannerPolicy:
    """Drives both robots by the privileged planner: the humanoid optimally, the drone to where it can tell."""

    def __init__(self, env: HouseholdEnv):
        """Plan for the episodes of an environment."""
        self.env = env

    def reset(self, seed: int | None) -> None:
        """Plan the episode that has just begun."""
        self._planner = CooperativePlanner(self.env.stage.oracle, self.env.setting.goal)

    def act(self, observations: Observations, infos: Infos) -> dict[str, int]:
        """Return the planner's action of each robot in the present state."""
        chosen = self._planner.choose({name: info["visible"] for name, info in infos.items()})
        return {name: self.env.action_names[name].index(action) for name, action in chosen.items()}


def _random(env: HouseholdEnv) -> Policy:
    return RandomPolicy({robot: len(names) for robot, names in env.action_names.items()})


_MAKERS: dict[str, Callable[[HouseholdEnv], Policy]] = {
    "random": _random,
    "open-loop": lambda env: OpenLoopPolicy(env.action_names),
    "reactive": lambda env: ReactivePolicy(env.action_names, env.rooms),
    "blind": lambda env: BlindPolicy(env.action_names, env.rooms),
    "instruction-blind": lambda env: InstructionBlindPolicy(env.action_names, env.rooms),
    "search": lambda env: SearchPolicy(env.action_names, env.rooms),
    "planner": PlannerPolicy,
}
POLICIES = tuple(_MAKERS)


def make_policy(name: str, env: Any) -> Policy:
    """Return a policy that comes with the benchmark.

    Args:
        name: "planner" (privileged, optimal), "search" (reads ``info["visible"]``: with scene graphs no more than they
            show, with pictures the truth), "random", or one that does without most of what a robot is given: "blind",
            "instruction-blind", "open-loop", "reactive".
        env: the ParallelEnv, or a view of it, that the policy is to drive.

    Raises:
        OptionError: there is no such policy.
    """
    if name not in _MAKERS:
        raise OptionError(f"unknown policy {name!r}; use one of: {', '.join(POLICIES)}")
    return _MAKERS[name](core_of(env))


def core_of(env: Any) -> HouseholdEnv:
    """Return the ParallelEnv behind an environment or a view of it.

    Raises:
        OptionError: it is none of this package's.
    """
    inner = env.unwrapped
    inner = getattr(inner, "parallel", inner)
    if not isinstance(inner, HouseholdEnv):
        raise OptionError(f"{type(env).__name__} is not an environment of chmarl_pb; make one by parallel_env()")
    return inner


def rollout(env: HouseholdEnv, policy: Policy, seed: int | None = None, task: Task | str | None = None) -> Episode:
    """Play one episode.

    Args:
        env: a ParallelEnv of this package.
        policy: drives both robots.
        seed: of the environment's reset and of the policy.
        task: the task to play, or its id; drawn by the environment if None.

    Raises:
        OptionError: the environment is not one of this package's, or a view of it.
    """
    if not isinstance(env, HouseholdEnv):
        raise OptionError(f"rollout() plays in what parallel_env() makes, not in {type(env).__name__}")
    observations, infos = env.reset(seed=seed, options=None if task is None else {"task": task})
    policy.reset(seed)
    seen, told, actions, rewards = [observations], [infos], [], []
    while env.agents:
        chosen = policy.act(observations, infos)
        observations, gained, _, _, infos = env.step(chosen)
        actions.append({name: int(chosen[name]) for name in AGENTS})
        rewards.append(gained[AGENTS[0]])
        seen.append(observations)
        told.append(infos)
    success = bool(infos[AGENTS[0]]["success"])
    return Episode(env.task, tuple(seen), tuple(actions), np.array(rewards), tuple(told), success)
