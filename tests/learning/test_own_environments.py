"""Environments, experts and weights of one's own that go wrong in play end with one sentence, and lose nothing."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces
from pettingzoo import ParallelEnv

import chmarl_pb
from chmarl_pb.errors import WorkerError
from chmarl_pb.learning import train
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.gradient import DivergedError
from chmarl_pb.learning.algorithms.mappo import MappoConfig
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.runs.run import BEST, LAST
from chmarl_pb.learning.storage.checkpoint import CheckpointError, fill, load
from tests.helpers.small_runs import IMITATION, SMALL, Constant
from tests.helpers.uneven_env import UnevenEnv
from tests.learning.test_workers import Elsewhere, die

torch.set_num_threads(1)  # these networks are too small for more


class Clock(ParallelEnv):  # type: ignore[misc]
    """One agent that sees which step it is, and is cut off after the last; the right one of two actions pays."""

    def __init__(self, steps: int = 6):
        self.possible_agents = ["one"]
        self.agents: list[str] = []
        self.steps = steps

    def observation_space(self, agent: str) -> spaces.Box:
        return spaces.Box(0, 1, (self.steps + 1,), np.float32)

    def action_space(self, agent: str) -> spaces.Discrete:
        return spaces.Discrete(2)

    def _seen(self) -> dict[str, np.ndarray]:
        return {"one": np.eye(self.steps + 1, dtype=np.float32)[self._time]}

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        self._time, self.agents = 0, ["one"]
        return self._seen(), {"one": {}}

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        paid, self._time = float(actions["one"] == self._time % 2), self._time + 1
        over = self._time == self.steps
        self.agents = [] if over else ["one"]
        return self._seen(), {"one": paid}, {"one": False}, {"one": over}, {"one": {}}


def test_values_stay_where_returns_are_though_the_last_state_comes_once() -> None:
    config = MappoConfig(
        episodes=960,
        horizon=6,
        envs=8,
        buffer_size=16,
        features=16,
        hidden=16,
        critic_units=16,
        critic_starts=0,
        learning_rate=3e-3,
    )
    learner: Any = train(Clock, "mappo", config).learner
    states = torch.eye(7)
    assert learner.value(states).abs().max() < 6  # an episode's return


@pytest.mark.parametrize("shared", [UnevenEnv(), chmarl_pb.parallel_env(split="val-unseen")])
def test_one_environment_cannot_play_several_episodes(shared: Any) -> None:
    with pytest.raises(ValueError, match="returns the same environment again"):
        train(lambda: shared, "vdn", SMALL)


class Changed(UnevenEnv):
    """An environment whose resets and steps are changed before they are returned."""

    def __init__(self, at_reset: Callable[..., Any] | None = None, at_step: Callable[..., Any] | None = None):
        super().__init__()
        self._at_reset, self._at_step = at_reset, at_step

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        start = super().reset(seed, options)
        return self._at_reset(self, start) if self._at_reset else start

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        result = super().step(actions)
        if self._at_step:
            self._at_step(self, *result)
        return result


def _nobody(env: Changed, start: Any) -> Any:
    env.agents = []
    return start


def _one_is_blind(env: Changed, start: Any) -> Any:
    return {"long": start[0]["long"]}, start[1]


@pytest.mark.parametrize(
    ("at_reset", "words"),
    [
        (lambda env, start: start[0], r"reset\(\) returns dict; return two dicts"),
        (lambda env, start: (start[0], None), r"reset\(\) returns tuple; return two dicts"),
        (_nobody, "an episode is over right after its reset"),
        (_one_is_blind, r"reset\(\) gives no observation of 'short'"),
    ],
)
def test_resets_that_begin_no_episode_are_refused(at_reset: Callable[..., Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        train(partial(Changed, at_reset), "vdn", SMALL)


def _unpaid_when_gone(env: Changed, seen: Any, rewards: Any, *_: Any) -> None:
    if "short" not in rewards:
        rewards["short"] = np.nan


def test_a_reward_that_is_no_number_is_named_at_once() -> None:
    def pay(env: Changed, seen: Any, rewards: Any, *_: Any) -> None:
        rewards["long"] = np.nan

    with pytest.raises(ValueError, match="the reward of 'long' in step 1 of an episode is nan"):
        train(partial(Changed, at_step=pay), "vdn", SMALL)


@pytest.mark.parametrize("algorithm", ["vdn", "iql"])
def test_what_agents_are_paid_that_are_gone_is_not_heard(algorithm: str, tmp_path: Path) -> None:
    train(partial(Changed, at_step=_unpaid_when_gone), algorithm, SMALL, tmp_path / "odd")
    train(UnevenEnv, algorithm, SMALL, tmp_path / "plain")
    odd, plain = (load(tmp_path / name / LAST, "run")["learner"]["networks"] for name in ("odd", "plain"))
    assert all(torch.equal(odd[name], plain[name]) for name in plain)


@pytest.mark.parametrize("time", [10, -1])
def test_choices_that_a_space_does_not_have_are_refused(time: int) -> None:
    def late(env: Changed, seen: Any, *_: Any) -> None:
        if "short" in seen:
            seen["short"]["time"] = time

    with pytest.raises(ValueError, match=f"key 'time', is {time}, and its observation_space goes from 0 to 9"):
        train(partial(Changed, at_step=late), "vdn", SMALL)


class Stateful(UnevenEnv):
    """An environment that keeps something under the name of PettingZoo's method."""

    def __init__(self) -> None:
        super().__init__()
        self.state = np.zeros(3)


def test_a_state_that_is_no_method_is_none() -> None:
    assert train(Stateful, "qmix", replace(SMALL, episodes=8)).learner.updates


def test_states_are_finite(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(UnevenEnv, "state", lambda env: None, raising=False)
    with pytest.raises(ValueError, match=r"state\(\) has infinite values, or what is no number"):
        train(UnevenEnv, "qmix", SMALL)


@pytest.mark.parametrize(
    ("actions", "words"),
    [
        ({"long": 0, "short": 1}, "would do 0 in the place of 'long', which the action_mask forbids"),
        ({"Long": 1}, "let it return a dict of actions by the names of agents: long, short"),
        (None, "the expert proposes None"),
    ],
)
def test_experts_name_agents_and_actions_that_are_allowed(actions: Any, words: str) -> None:
    class Other(Constant):
        def note(self, actions: Any) -> None:
            """Learn nothing."""

        def propose(self, observations: Any, infos: Any) -> Any:
            return actions

    with pytest.raises(ValueError, match=words):
        train(UnevenEnv, "imitation", IMITATION, expert=partial(Other, actions={}))


def test_weights_that_a_step_has_made_infinite_are_not_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = DAggerConfig(**{**vars(IMITATION), "episodes": 8})

    def explode(self: Any, batch: Batch) -> Any:
        with torch.no_grad():
            next(self.agents.parameters()).fill_(torch.inf)
        return {"loss": torch.zeros(())}

    monkeypatch.setattr("chmarl_pb.learning.algorithms.dagger.DAgger.update", explode)
    with pytest.raises(DivergedError, match="weights are infinite or no numbers after a gradient step"):
        train(UnevenEnv, "imitation", config, tmp_path, expert=partial(Constant, actions={"long": 2, "short": 1}))
    assert not (tmp_path / BEST).exists()


def test_a_process_that_dies_loses_no_episodes(tmp_path: Path) -> None:
    config = replace(SMALL, workers=2)
    count = tmp_path / "count"
    with pytest.raises(WorkerError, match=r"died after \d+ episodes .* goes on from .*; fewer workers need another"):
        train(partial(Elsewhere, partial(_die_late, count, 30)), "vdn", config, tmp_path / "run")
    assert load(tmp_path / "run" / LAST, "run")["episodes"] > 0
    train(partial(Elsewhere, partial(_die_late, count, 10**9)), "vdn", config, tmp_path / "run")
    train(UnevenEnv, "vdn", config, tmp_path / "whole")
    found, whole = (load(tmp_path / name / BEST, "value")["agents"] for name in ("run", "whole"))
    assert all(torch.equal(found[name], whole[name]) for name in whole)


def _die_late(count: Path, steps: int) -> None:
    """End the process after so many steps."""
    done = len(count.read_bytes()) if count.exists() else 0
    count.write_bytes(b"x" * (done + 1))
    if done + 1 >= steps:
        die()


def test_best_weights_that_are_damaged_are_written_again_or_missed(tmp_path: Path) -> None:
    train(UnevenEnv, "vdn", replace(SMALL, episodes=32), tmp_path)
    whole = (tmp_path / BEST).read_bytes()
    (tmp_path / BEST).write_bytes(whole[:-200])
    with pytest.raises(CheckpointError, match=r"best\.pt: not a whole checkpoint"):
        train(UnevenEnv, "vdn", replace(SMALL, episodes=32), tmp_path)


@pytest.mark.parametrize("given", [{"validate": 5}, {"threads": "2"}, {"threads": 100_000}])
def test_arguments_are_checked_before_anything_is_made(given: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match=next(iter(given))):
        train(UnevenEnv, "vdn", SMALL, **given)


def test_weights_that_do_not_fit_are_told_in_a_line() -> None:
    many = torch.nn.ModuleDict({f"layer_{number}": torch.nn.Linear(2, 2) for number in range(200)})
    with pytest.raises(CheckpointError) as told:
        fill(many, {}, Path("best.pt"))
    assert len(str(told.value)) < 600
