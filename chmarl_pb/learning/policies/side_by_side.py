"""Play an evaluation's episodes side by side in one process, as ``plays`` of :func:`chmarl_pb.evaluate`."""

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import Episode, core_of_parallel
from chmarl_pb.envs.words import action_number
from chmarl_pb.evaluation.metrics import Played, played
from chmarl_pb.evaluation.play import Job, Setup, seeds_to_play
from chmarl_pb.learning.rollouts.batched import BatchedPolicy, as_batched, play_together
from chmarl_pb.policies.policy import Actions
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.tidy_task import AnyTask

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
            policy = as_batched(setup.make_policies(envs))
        for first in range(0, len(jobs), width):
            yield from _play(policy, envs, jobs[first : first + width])
    finally:
        for env in envs:
            env.close()


def _play(policy: BatchedPolicy, envs: Sequence[Any], jobs: Sequence[Job]) -> Iterator[Played]:
    """Yield one episode of each job."""
    seeds, own = zip(*(seeds_to_play(env, *job) for env, job in zip(envs, jobs, strict=False)), strict=True)
    for end in play_tasks(policy, envs, [task for task, _ in jobs], seeds, own):
        task, seed = jobs[end.number]
        how = end.core.outcome.success, end.core.outcome.potential, end.core.steps
        yield played(end.core, Episode(task, (), tuple(end.actions), np.zeros(0), (), *how), seed, end.outcomes)


class End(NamedTuple):
    """An episode that has just ended: its number and environment, the numbers of all actions, all outcomes so far."""

    number: int
    core: HouseholdEnv
    actions: list[Actions]
    outcomes: list[Outcome]


def play_tasks(
    policy: BatchedPolicy,
    envs: Sequence[Any],
    tasks: Sequence[AnyTask],
    seeds: Sequence[int],
    policy_seeds: Sequence[int] | None = None,
) -> Iterator[End]:
    """Play one task in each of the first environments; yield each as soon as it has ended, before the next step.

    Args:
        policy: drives all of them.
        envs: environments of the benchmark, of one kind.
        tasks: which, at most as many as there are environments.
        seeds: of the resets.
        policy_seeds: of the policy, if it is not to get those of the resets.
    """
    ends = [End(number, core_of_parallel(env), [], []) for number, env in enumerate(envs[: len(tasks)])]
    options = [{"task": task} for task in tasks]
    for number, actions, _ in play_together(envs[: len(tasks)], policy, seeds, options, policy_seeds):
        end, core = ends[number], ends[number].core
        end.outcomes.append(core.outcome)
        if actions is not None:
            end.actions.append(
                {
                    name: action_number(name, actions[name], core.symbols)
                    for name in core.possible_agents
                    if name in actions
                }
            )
            if not envs[number].agents:
                yield end
