"""Play an evaluation's episodes side by side in one process, as ``plays`` of :func:`chmarl_pb.evaluate`."""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from chmarl_pb.envs.rollout import Episode, core_of_parallel
from chmarl_pb.envs.words import action_number
from chmarl_pb.evaluation.metrics import Played, played
from chmarl_pb.evaluation.play import Job, Setup, seeds_of
from chmarl_pb.learning.rollouts.batched import BatchedPolicy, as_batched, play_together
from chmarl_pb.policies.policy import Actions
from chmarl_pb.policies.seats import seated
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.tasks.outcome import Outcome

WIDTH = 8  # episodes side by side: more environments take more memory and are hardly faster


def play_side_by_side(setup: Setup, jobs: Sequence[Job], width: int = WIDTH) -> Iterator[Played]:
    """Yield the played episodes, in no certain order.

    Args:
        setup: policy and options.
        jobs: what to play.
        width: number of environments.
    """
    envs = [setup.make_env() for _ in range(min(width, len(jobs)))]
    try:
        if envs:
            source = find_policy(setup.policy)
            policy = as_batched([seated(source.make, env, setup.privileged, source.centralized) for env in envs])
        for first in range(0, len(jobs), width):
            yield from _play(policy, envs, jobs[first : first + width])
    finally:
        for env in envs:
            env.close()


def _play(policy: BatchedPolicy, envs: Sequence[Any], jobs: Sequence[Job]) -> Iterator[Played]:
    """Yield one episode of each job."""
    seeds, own = zip(*(seeds_of(env, *job) for env, job in zip(envs, jobs, strict=False)), strict=True)
    options = [{"task": task} for task, _ in jobs]
    chosen: list[list[Actions]] = [[] for _ in jobs]
    outcomes: list[list[Outcome]] = [[] for _ in jobs]
    for number, actions, result in play_together(envs[: len(jobs)], policy, seeds, options, own):
        core = core_of_parallel(envs[number])
        outcomes[number].append(core.outcome)
        if actions is None:
            continue
        chosen[number].append({name: action_number(name, actions[name], core.symbols) for name in core.possible_agents})
        if not envs[number].agents:
            task, seed = jobs[number]
            end = core.outcome.success, core.outcome.potential, core.steps
            yield played(
                core, Episode(task, (), tuple(chosen[number]), np.zeros(0), (result[4],), *end), seed, outcomes[number]
            )
