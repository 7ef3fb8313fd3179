"""Play an evaluation's episodes side by side in one process: a network sees all of them in one batch.

Every episode gets the observations, seeds and random draws that it gets when it is played alone. Sums over a larger
batch may differ in the last bit, so two actions that are valued the same to seven digits could change places; no
episode of our checkpoints has shown it (``tests/learning/test_batched_policies.py``).
"""

from collections.abc import Iterator, Sequence
from typing import Any, Protocol

import numpy as np
import torch

from chmarl_pb.envs.parallel import AGENTS
from chmarl_pb.envs.rollout import Episode, core_of_parallel
from chmarl_pb.evaluation.metrics import Played, played
from chmarl_pb.evaluation.play import Job, Setup, episode_seed
from chmarl_pb.learning.algorithms.losses import best_legal
from chmarl_pb.learning.networks.agents import NO_ACTION, Player
from chmarl_pb.learning.networks.frozen import frozen_encoder
from chmarl_pb.learning.networks.kept_features import all_with_features
from chmarl_pb.learning.policies.cloned import ClonedPolicy
from chmarl_pb.learning.policies.learned import LearnedPolicy
from chmarl_pb.learning.runs.threads import threads
from chmarl_pb.learning.spaces import stack, tensors
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.sources import find_policy

WIDTH = 8  # episodes side by side: more environments take more memory and are hardly faster


class Crowd(Protocol):
    """Drives several episodes at once."""

    def reset(self, seeds: Sequence[int]) -> None:
        """Begin one episode for each seed."""

    def act(self, places: Sequence[int], seen: Sequence[Observations], told: Sequence[Infos]) -> list[Actions]:
        """Return the actions in the episodes with these numbers."""


def play_side_by_side(setup: Setup, jobs: Sequence[Job], width: int = WIDTH) -> Iterator[Played]:
    """Yield the played episodes, in no certain order; see ``plays`` of :func:`chmarl_pb.evaluate`.

    Args:
        setup: policy and options.
        jobs: what to play.
        width: number of environments.
    """
    envs = [setup.make_env() for _ in range(min(width, len(jobs)))]
    try:
        if envs:
            crowd = crowd_of([find_policy(setup.policy).make(env) for env in envs])
        for first in range(0, len(jobs), width):
            yield from _play_wave(crowd, envs, jobs[first : first + width])
    finally:
        for env in envs:
            env.close()


def _play_wave(crowd: Crowd, envs: Sequence[Any], jobs: Sequence[Job]) -> Iterator[Played]:
    """Yield one episode of each job."""
    seeds = [episode_seed(task, seed) for task, seed in jobs]
    starts = [
        env.reset(seed=seed, options={"task": task}) for env, seed, (task, _) in zip(envs, seeds, jobs, strict=False)
    ]
    seen, told = [start[0] for start in starts], [start[1] for start in starts]
    chosen: list[list[Actions]] = [[] for _ in jobs]
    crowd.reset(seeds)
    while running := [place for place in range(len(jobs)) if envs[place].agents]:
        actions = crowd.act(running, [seen[place] for place in running], [told[place] for place in running])
        for place, action in zip(running, actions, strict=True):
            seen[place], _, _, _, told[place] = envs[place].step(action)
            chosen[place].append({name: int(action[name]) for name in AGENTS})
            if not envs[place].agents:
                (task, seed), core = jobs[place], core_of_parallel(envs[place])
                end = core.outcome.success, core.outcome.potential, core.steps
                yield played(Episode(task, (), tuple(chosen[place]), np.zeros(0), (told[place],), *end), seed)


def crowd_of(policies: Sequence[Policy]) -> Crowd:
    """Return what plays as a checkpoint's policies do, one for each episode, all of the same weights."""
    first = policies[0]
    if isinstance(first, LearnedPolicy):
        return LearnedCrowd(first)
    if isinstance(first, ClonedPolicy) and first.config.temperature == 0:
        return ClonedCrowd(first)
    if hasattr(first, "crowd"):  # chmarl_pb.learning.sb3.policy, which needs Stable-Baselines3
        return first.crowd
    return Apart(policies)


class Apart:
    """Policies that know nothing of each other: any policy can be played so."""

    def __init__(self, policies: Sequence[Policy]):
        """Take one policy for each episode."""
        self.policies = policies

    def reset(self, seeds: Sequence[int]) -> None:
        """Begin one episode for each seed."""
        for policy, seed in zip(self.policies, seeds, strict=False):
            policy.reset(seed)

    def act(self, places: Sequence[int], seen: Sequence[Observations], told: Sequence[Infos]) -> list[Actions]:
        """Return the actions in the episodes with these numbers."""
        return [self.policies[place].act(*rest) for place, *rest in zip(places, seen, told, strict=True)]


class LearnedCrowd:
    """Plays as :class:`chmarl_pb.learning.policies.learned.LearnedPolicy`."""

    def __init__(self, policy: LearnedPolicy):
        """Take a policy's networks over."""
        self.policy = policy

    def reset(self, seeds: Sequence[int]) -> None:
        """Begin one episode for each seed."""
        self._player = Player(self.policy.agents, len(seeds))

    @threads(1)
    def act(self, places: Sequence[int], seen: Sequence[Observations], told: Sequence[Infos]) -> list[Actions]:
        """Return each agent's best legal action."""
        seen = all_with_features(seen, self.policy.encoder) if self.policy.encoder else seen
        index, chosen = torch.tensor(places), [Actions() for _ in places]
        for name in AGENTS:
            batch = stack([robots[name] for robots in seen])
            batch |= {key: np.zeros_like(batch[key]) for key in self.policy.silenced}
            values = self._player.values(name, index, tensors(batch))
            everything = np.ones(values.shape[1])
            legal = np.stack([infos[name].get("action_mask", everything) for infos in told]).astype(bool)
            best = best_legal(values, torch.from_numpy(legal))
            self._player.remember(name, index, best)
            for actions, number in zip(chosen, best.tolist(), strict=True):
                actions[name] = number
        return chosen


class ClonedCrowd:
    """Plays as :class:`chmarl_pb.learning.policies.cloned.ClonedPolicy` without chance."""

    def __init__(self, policy: ClonedPolicy):
        """Take a policy's networks over."""
        self.minds, self.config = policy.minds, policy.config

    def reset(self, seeds: Sequence[int]) -> None:
        """Begin one episode for each seed."""
        self._hidden = [torch.zeros(1, len(seeds), self.config.hidden) for _ in self.minds]
        self._last = {name: torch.full((len(seeds),), NO_ACTION) for name in AGENTS}

    @threads(1)
    @torch.no_grad()
    def act(self, places: Sequence[int], seen: Sequence[Observations], told: Sequence[Infos]) -> list[Actions]:
        """Return each robot's likeliest action."""
        index = torch.tensor(places)
        if self.config.uses_features:
            seen = all_with_features(seen, frozen_encoder(self.config.image_encoder))
        batch = stack([{f"{name}_{key}": part for name in AGENTS for key, part in one[name].items()} for one in seen])
        steps = {key: part.unsqueeze(1) for key, part in tensors(batch).items()}
        for number, (group, mind) in enumerate(zip(self.config.groups, self.minds, strict=True)):
            last = torch.stack([self._last[name][index] for name in group], dim=-1).unsqueeze(1)
            logits, after = mind(steps, last, self._hidden[number][:, index])
            self._hidden[number][:, index] = after
            for name, values in zip(group, logits, strict=True):
                self._last[name][index] = values[:, 0].argmax(dim=1)
        return [{name: int(self._last[name][place]) for name in AGENTS} for place in places]
