"""Gymnasium's own wrappers on the ids of the humanoid."""

from collections.abc import Callable
from contextlib import closing
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium import wrappers

import chmarl_pb
from chmarl_pb.envs.tracks import PAPER, TRACKS

LIMIT = TRACKS[PAPER]["max_steps"]
STAY = 9

LOW, HIGH = np.float32(-1), np.float32(1)

WRAPPED: dict[str, Callable[[Any], Any]] = {
    "Autoreset": wrappers.Autoreset,
    "DelayObservation": lambda env: wrappers.DelayObservation(env, 1),
    "FilterObservation": lambda env: wrappers.FilterObservation(env, ["self", "messages"]),
    "FlattenObservation": wrappers.FlattenObservation,
    "FrameStackObservation": lambda env: wrappers.FrameStackObservation(env, 3),
    "NormalizeObservation, flat": lambda env: wrappers.NormalizeObservation(chmarl_pb.FlatObservation(env)),
    "NormalizeReward": wrappers.NormalizeReward,
    "RecordEpisodeStatistics": wrappers.RecordEpisodeStatistics,
    "RescaleObservation, flattened": lambda env: wrappers.RescaleObservation(
        wrappers.FlattenObservation(env), LOW, HIGH
    ),
    "StickyAction": lambda env: wrappers.StickyAction(env, 0.5),
    "TimeAwareObservation": wrappers.TimeAwareObservation,
    "TimeAwareObservation, Dict": lambda env: wrappers.TimeAwareObservation(env, flatten=False),
    "TimeAwareObservation, flat": lambda env: wrappers.TimeAwareObservation(chmarl_pb.FlatObservation(env)),
    "TransformReward": lambda env: wrappers.TransformReward(env, lambda reward: float(reward) / 10),
}


def make(env_id: str) -> Any:
    return gymnasium.make(env_id, split="val-unseen", image_size=32)


@pytest.mark.parametrize("env_id", ["CHMARL/SceneGraphHumanoid-v1", "CHMARL/VisualHumanoid-v1"])
@pytest.mark.parametrize("name", WRAPPED)
def test_an_episode_in_the_wrapper(name: str, env_id: str) -> None:
    with closing(WRAPPED[name](make(env_id))) as env:
        observation, _ = env.reset(seed=0)
        for step in range(1, LIMIT + 1):
            assert env.observation_space.contains(observation)
            observation, _, terminated, truncated, _ = env.step(STAY)
            assert not terminated and truncated == (step == LIMIT)


def test_time_statistics_and_rewards_are_right() -> None:
    env = wrappers.TimeAwareObservation(make("CHMARL/SceneGraphHumanoid-v1"), flatten=False, normalize_time=True)
    statistics = wrappers.RecordEpisodeStatistics(env)
    tenths: Any = wrappers.TransformReward(statistics, lambda reward: float(reward) / 10)
    with closing(tenths):
        seen, _ = tenths.reset(seed=0)
        times, ended = [seen["time"].item()], False
        rewards: list[float] = []
        while not ended:
            seen, reward, terminated, truncated, info = tenths.step(len(rewards) % STAY)
            times.append(seen["time"].item())
            rewards.append(reward)
            ended = terminated or truncated
        np.testing.assert_allclose(times, np.arange(len(times)) / LIMIT, rtol=1e-5)
        assert info["episode"]["l"] == len(rewards) and info["episode"]["r"] == pytest.approx(10 * sum(rewards))


def test_normalize_observation_asks_for_a_vector() -> None:
    with closing(make("CHMARL/SceneGraphHumanoid-v1")) as env, pytest.raises((ValueError, AssertionError)):
        wrappers.NormalizeObservation(env)
