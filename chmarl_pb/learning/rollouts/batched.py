"""Policies that drive several episodes at once: a network sees all of them in one batch.

This is the general case; a policy for one episode is a batch of one.

Every episode gets the observations, seeds and random draws that it gets when it is played alone. Sums over a larger
batch may differ in the last bit, so two actions that are valued the same to seven digits could change places; no
episode of our checkpoints has shown it (``tests/learning/test_batched_policies.py``).
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any, Protocol

from chmarl_pb.learning.networks.kept_features import reset_all, step_all
from chmarl_pb.learning.spaces import two_dicts
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.seats import CommonSeat, Seats, masks_of


class BatchedPolicy(Protocol):
    """Drives several episodes side by side.

    >>> class Stay:
    ...     def reset(self, seeds):
    ...         pass
    ...
    ...     def act(self, episodes, observations, infos):
    ...         return [{robot: len(info["action_mask"]) - 1 for robot, info in one.items()} for one in infos]
    >>> env = chmarl_pb.parallel_env(split="val-unseen", max_steps=3)
    >>> chmarl_pb.rollout(env, BatchOfOne(Stay()), seed=0).steps
    3
    """

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed; they are numbered from 0."""

    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return the actions in the episodes with these numbers, of the agents that are observed there."""


class BatchOfOne:
    """A batched policy as a policy for one episode.

    Attributes:
        batched: the policy.
    """

    def __init__(self, batched: BatchedPolicy):
        """Take a policy over."""
        self.batched = batched

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self.batched.reset([seed])

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action."""
        return self.batched.act([0], [observations], [infos])[0]


class IndependentPolicies:
    """Policies that know nothing of each other, one for each episode: any policy can be played so."""

    def __init__(self, policies: Sequence[Policy]):
        """Take one policy for each episode."""
        self.policies = policies

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed."""
        for policy, seed in zip(self.policies, seeds, strict=False):
            policy.reset(seed)

    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return the actions in the episodes with these numbers."""
        return [self.policies[number].act(*rest) for number, *rest in zip(episodes, observations, infos, strict=True)]


class BatchedSeats:
    """A batched policy for each robot, which gets nothing but that robot's observations and action masks."""

    def __init__(self, policies: Mapping[str, BatchedPolicy]):
        """Take one for each robot."""
        self.policies = policies

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed."""
        for policy in self.policies.values():
            policy.reset(seeds)

    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return the actions in the episodes with these numbers."""
        chosen: list[Actions] = [{} for _ in episodes]
        masks = [masks_of(info) for info in infos]
        for robot, policy in self.policies.items():
            seen, allowed = ([{robot: of[robot]} for of in parts] for parts in (observations, masks))
            for actions, own in zip(chosen, policy.act(episodes, seen, allowed), strict=True):
                actions[robot] = own[robot]
        return chosen


def as_batched(policies: Sequence[Policy]) -> BatchedPolicy:
    """Return what drives several episodes as these policies do, all of one source, one for each episode."""
    first = policies[0]
    if isinstance(first, Seats):
        seats = [policy.policies for policy in policies if isinstance(policy, Seats)]
        return BatchedSeats({robot: as_batched([one[robot] for one in seats]) for robot in first.policies})
    inner = first.policy if isinstance(first, CommonSeat) else first
    return inner.batched if isinstance(inner, BatchOfOne) else IndependentPolicies(policies)


def play_together(
    envs: Sequence[Any],
    policy: BatchedPolicy,
    seeds: Sequence[int],
    options: Sequence[dict[str, Any] | None],
    policy_seeds: Sequence[int] | None = None,
) -> Iterator[tuple[int, Actions | None, tuple[Any, ...]]]:
    """Play one episode in each environment, all of one kind, step by step.

    Args:
        envs: ParallelEnvs.
        policy: drives all of them.
        seeds: of the resets.
        options: of the resets.
        policy_seeds: of the policy, if it is not to get those of the resets.

    Yields:
        The number of an episode, its actions, and what the step returned; at first None, and what the reset returned.
    """
    starts = reset_all(envs, seeds, options)
    latest: dict[int, tuple[Any, Any]] = {number: two_dicts(start) for number, start in enumerate(starts)}
    policy.reset(seeds if policy_seeds is None else policy_seeds)
    for number, start in latest.items():
        yield number, None, start
    while running := [number for number, env in enumerate(envs) if env.agents]:
        seen = [{name: latest[number][0][name] for name in envs[number].agents} for number in running]
        actions = policy.act(running, seen, [latest[number][1] for number in running])
        own = [{name: deepcopy(action) for name, action in one.items()} for one in actions]  # for them to change
        results = step_all([envs[number] for number in running], own)
        for number, action, result in zip(running, actions, results, strict=True):
            latest[number] = _observed(result, envs[number])
            yield number, action, result


def _observed(step: Any, env: Any) -> tuple[Any, Any]:
    """Return the observations and the infos of what a step has returned.

    Raises:
        ValueError: it is not what a ParallelEnv returns, or does not say what those who are there observe.
    """
    if not isinstance(step, tuple | list) or len(step) != 5 or not all(isinstance(one, Mapping) for one in step):
        raise ValueError(
            f"step() returns {_kinds(step)}; return five dicts by the names of agents, as PettingZoo's ParallelEnv "
            "does: observations, rewards, terminations, truncations, infos"
        )
    if blind := [name for name in env.agents if name not in step[0]]:
        raise ValueError(
            f"step() gives no observation of {blind[0]!r}, which env.agents still names; return one for each of them"
        )
    return step[0], step[4]


def _kinds(returned: Any) -> str:
    """Return what was returned, in a few words."""
    return ", ".join(type(one).__name__ for one in returned) if isinstance(returned, tuple) else type(returned).__name__
