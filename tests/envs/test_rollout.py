"""The one loop: on wrapped environments as on plain ones, watched, and honest about what wrappers do."""

import doctest
from importlib import import_module
from typing import Any

import numpy as np
import pytest
from pettingzoo.utils import BaseParallelWrapper

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv, Results
from chmarl_pb.envs.rollout import Episode, rollout
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.golden import digest
from chmarl_pb.policies.policy import Actions, Infos, Observations
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.replay import ReplayPolicy
from chmarl_pb.tasks.splits import load_tasks

TASK = load_tasks("test-unseen")[0]


class Twice(BaseParallelWrapper):  # type: ignore[misc]
    """Carries out every action twice, and hides all infos but the visible names and the mask."""

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, Infos]:
        observations, infos = self.env.reset(seed=seed, options=options)
        return observations, self._few(infos)

    def step(self, actions: Actions) -> Results:
        results = self.env.step(actions)
        if self.env.agents:
            results = self.env.step(actions)
        observations, rewards, ended, cut, infos = results
        return observations, rewards, ended, cut, self._few(infos)

    def _few(self, infos: Infos) -> Infos:
        return {name: {key: info[key] for key in ("visible", "action_mask")} for name, info in infos.items()}


def same(one: Episode, other: Episode) -> bool:
    first, second = (digest(*e.observations, *e.infos, *e.actions, e.rewards, e.success, e.steps) for e in (one, other))
    return first == second


@pytest.fixture(scope="module")
def plain(env: HouseholdEnv) -> Episode:
    return rollout(env, make_policy("planner", env), seed=3, task=TASK)


def test_a_wrapper_that_changes_nothing_changes_nothing(env: HouseholdEnv, plain: Episode) -> None:
    wrapped = BaseParallelWrapper(BaseParallelWrapper(env))
    assert same(plain, rollout(wrapped, make_policy("planner", wrapped), seed=3, task=TASK))


def test_supersuit_wraps(env: HouseholdEnv, plain: Episode) -> None:
    supersuit = pytest.importorskip("supersuit")
    wrapped = supersuit.pad_action_space_v0(env)
    episode = rollout(wrapped, make_policy("planner", wrapped), seed=3, task=TASK)
    assert (episode.actions, episode.success, episode.steps) == (plain.actions, True, TASK.optimal_steps)


def test_what_counts_is_what_happened(env: HouseholdEnv) -> None:
    """Steps, success and potential are those of the home, not what a wrapper lets through."""
    policy = ReplayPolicy([(9, 8)] * 3, env)
    episode = rollout(Twice(env), policy, seed=0, task=TASK)
    assert (len(episode), episode.steps, episode.success) == (14, 28, False)
    assert episode.potential == env.outcome.potential and "potential" not in episode.infos[-1]["humanoid"]


class Arrays(ReplayPolicy):
    """Answers with arrays of one number, as policies of vectors do."""

    def act(self, observations: Any, infos: Any) -> dict[str, Any]:
        return {robot: np.array([action]) for robot, action in super().act(observations, infos).items()}


def test_actions_are_numbers_or_arrays_of_one(env: HouseholdEnv, plain: Episode) -> None:
    rows = [tuple(actions.values()) for actions in plain.actions]
    assert same(plain, rollout(env, Arrays(rows, env), seed=3, task=TASK))


def test_watching(env: HouseholdEnv, plain: Episode) -> None:
    seen: list[tuple[int, float]] = []
    wrapped = BaseParallelWrapper(env)
    watched = rollout(
        wrapped,
        make_policy("planner", env),
        3,
        TASK,
        on_step=lambda core: seen.append((core.steps, core.outcome.potential)),
    )
    assert same(plain, watched)
    assert seen == [(step, info["drone"]["potential"]) for step, info in enumerate(plain.infos)]


def test_a_replay_repeats_and_then_stays(env: HouseholdEnv, plain: Episode) -> None:
    rows = [tuple(actions.values()) for actions in plain.actions]
    assert same(plain, rollout(env, ReplayPolicy(rows, env), seed=3, task=TASK))
    policy = ReplayPolicy(rows[:2], env)
    cut = rollout(env, policy, seed=3, task=TASK).actions
    assert cut[:2] == plain.actions[:2] and set(map(tuple, (row.values() for row in cut[2:]))) == {(9, 8)}


@pytest.mark.parametrize("make", [chmarl_pb.env, lambda: object()])
def test_other_interfaces_are_refused(make: Any) -> None:
    env = make()
    with pytest.raises(OptionError, match="not a ParallelEnv"):
        rollout(env, policy=None)  # type: ignore[arg-type]
    getattr(env, "close", lambda: None)()


@pytest.mark.parametrize("name", ["chmarl_pb.envs.rollout", "chmarl_pb.evaluation.protocol"])
def test_examples_of_docstrings(name: str) -> None:
    done = doctest.testmod(import_module(name), extraglobs={"chmarl_pb": chmarl_pb})
    assert done.attempted and not done.failed
