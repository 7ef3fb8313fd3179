"""The one loop: a policy drives an environment through an episode."""

from dataclasses import dataclass

import numpy as np

from chmarl_pb.envs.parallel import AGENTS, HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.policy import Infos, Observations, Policy
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
