"""The one loop: a policy drives an environment through an episode, and whoever wants to may watch."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from pettingzoo import AECEnv

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.words import action_number
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.policy import Infos, Observations, Policy, require_policy
from chmarl_pb.tasks.tidy_task import AnyTask

#: Called after the reset and after each step with the innermost environment, which it may read but not change.
OnStep = Callable[[HouseholdEnv], Any]


@dataclass(frozen=True, eq=False)
class Episode:
    """One played episode; T is its number of actions of each robot.

    Attributes:
        task: the task.
        observations: T + 1 times robot -> observation, as the policy got it.
        actions: T times robot -> number of its action, as the policy chose it.
        rewards: (T,) shared rewards, as the environment gave them.
        infos: T + 1 times robot -> info.
        success: whether X stands on Y, whatever a wrapper says.
        potential: phi at the end.
        steps: joint steps of the home; T, unless a wrapper repeats or skips actions.
        said: T times robot -> symbol that it said; empty dicts without own words.
    """

    task: AnyTask
    observations: tuple[Observations, ...]
    actions: tuple[dict[str, int], ...]
    rewards: np.ndarray
    infos: tuple[Infos, ...]
    success: bool
    potential: float
    steps: int
    said: tuple[dict[str, int], ...] = ()

    def __len__(self) -> int:
        """Return the number of actions of each robot."""
        return len(self.actions)


def rollout(
    env: Any,
    policy: Policy,
    seed: int | None = None,
    task: AnyTask | str | None = None,
    on_step: OnStep | None = None,
    policy_seed: int | None = None,
) -> Episode:
    """Play one episode.

    >>> env = chmarl_pb.parallel_env(split="val-unseen")
    >>> rooms = []
    >>> episode = chmarl_pb.rollout(
    ...     env, chmarl_pb.make_policy("planner", env), seed=0, on_step=lambda env: rooms.append(env.outcome.item_room)
    ... )
    >>> len(rooms) == len(episode) + 1
    True

    Args:
        env: a ParallelEnv of this package, or wrappers around one (of PettingZoo, SuperSuit or your own).
        policy: drives all robots.
        seed: of the environment's reset and of the policy.
        task: the task to play, or its id; drawn by the environment if None.
        on_step: watches.
        policy_seed: of the policy, if it is not to get that of the reset.

    Raises:
        OptionError: the environment is not made from one of this package's, is no ParallelEnv, or the policy is none.
    """
    core, policy = core_of_parallel(env), require_policy(policy)
    watch = on_step or _look_away
    observations, infos = env.reset(seed=seed, options=None if task is None else {"task": task})
    policy.reset(seed if policy_seed is None else policy_seed)
    watch(core)
    all_observations, all_infos, actions, rewards = [observations], [infos], [], []
    said: list[dict[str, int]] = []
    while env.agents:
        chosen = policy.act(observations, infos)
        observations, reward, _, _, infos = env.step(chosen)
        actions.append({name: action_number(name, chosen[name], core.symbols) for name in core.possible_agents})
        said.append(core.said)
        rewards.append(reward[core.possible_agents[0]])
        all_observations.append(observations)
        all_infos.append(infos)
        watch(core)
    return Episode(
        core.task, tuple(all_observations), tuple(actions), np.array(rewards), tuple(all_infos),
        core.outcome.success, core.outcome.potential, core.steps, tuple(said),
    )  # fmt: skip


def core_of_parallel(env: Any) -> HouseholdEnv:
    """Return the innermost environment of a ParallelEnv.

    Raises:
        OptionError: it is not one of this package's, or is seen through another interface.
    """
    core = getattr(env, "unwrapped", None)
    if not isinstance(core, HouseholdEnv) or isinstance(env, AECEnv):
        raise OptionError(
            f"{type(env).__name__} is not a ParallelEnv made from this package's; make one by parallel_env() and "
            "wrap it in wrappers whose `unwrapped` leads back to it"
        )
    return core


def _look_away(env: HouseholdEnv) -> None:
    """Watch nothing."""
