"""The humanoid's environment: the partner that acts by itself follows the seed, too."""

from contextlib import closing
from typing import Any

import gymnasium
import numpy as np
import pytest

import chmarl_pb


@pytest.mark.filterwarnings("ignore:.*out of date")
@pytest.mark.parametrize("robots", [("humanoid", "humanoid"), ("humanoid", "drone")])
@pytest.mark.parametrize("env_id", ["CHMARL/SceneGraphHumanoid-v0", "CHMARL/SceneGraphHumanoid-v1"])
def test_episodes_after_a_seed_are_the_same_every_time(env_id: str, robots: tuple[str, ...]) -> None:
    def rollout(env: Any) -> list[Any]:
        found = [env.reset(seed=7)[0]]
        for episode in range(5):
            done = False
            while not done:
                observation, _, terminated, truncated, _ = env.step((episode + len(found)) % 10)
                found.append(observation)
                done = terminated or truncated
            found.append(env.reset()[0])
        return found

    with closing(gymnasium.make(env_id, robots=robots, split="val-unseen", max_steps=12)) as env:
        first, second = rollout(env), rollout(env)
    assert len(first) == len(second)
    for one, other in zip(first, second, strict=True):
        assert all(np.array_equal(one[key], other[key]) for key in one)


def test_the_environment_has_the_random_stream_that_wrappers_ask_for() -> None:
    with closing(chmarl_pb.parallel_env(split="val-unseen")) as env:
        drawn = []
        for _ in range(2):
            env.reset(seed=3)
            drawn.append(int(env.np_random.integers(2**31)))
        assert drawn[0] == drawn[1]
