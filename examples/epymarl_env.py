"""The flat view as EPyMARL's `gymma` environments are: lists of vectors, actions and rewards, one for each robot.

In a checkout of EPyMARL (https://github.com/uoe-agents/epymarl), with this package installed beside it:
PYTHONPATH=path/to/chmarl_pb/examples python src/main.py --config=qmix --env-config=gymma \
    with env_args.time_limit=28 env_args.key="epymarl_env:Household-v0"

`HouseholdGoal-v0` tells the classes of X and Y and whether they are in view, in 22 numbers; for other options of
`chmarl_pb.flat_env` register an id of your own, as below, since EPyMARL takes no further `env_args`. This file by
itself plays an episode at random: python examples/epymarl_env.py
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces

import chmarl_pb

Vectors = tuple[np.ndarray, ...]


class Household(gymnasium.Env[Vectors, Any]):
    """All robots at once, in the order of ``possible_agents``; ``info["success"]`` is a number."""

    def __init__(self, **options: Any):
        """Make the environment; see :func:`chmarl_pb.flat_env` for the options."""
        self._env = chmarl_pb.flat_env(**options)
        self._robots = self._env.possible_agents
        self.n_agents = len(self._robots)
        self.observation_space = spaces.Tuple([self._env.observation_space(robot) for robot in self._robots])
        _, infos = self._env.reset(seed=0)
        counts = [int(infos[robot]["action_mask"].sum()) for robot in self._robots]  # the drone has fewer actions
        self.action_space = spaces.Tuple([spaces.Discrete(count) for count in counts])

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Vectors, dict[str, Any]]:
        """Start an episode."""
        super().reset(seed=seed)
        observations, _ = self._env.reset(seed=seed, options=options)
        return tuple(observations[robot] for robot in self._robots), {}

    def step(self, action: Any) -> tuple[Vectors, list[float], bool, bool, dict[str, Any]]:  # type: ignore[override]
        """Let all robots act once. They are all there until the end, and are all paid the same."""
        actions = dict(zip(self._robots, map(int, action), strict=True))
        observations, rewards, ended, cut, infos = self._env.step(actions)
        vectors = tuple(observations[robot] for robot in self._robots)
        paid = [rewards[robot] for robot in self._robots]
        success = float(infos[self._robots[0]]["success"])
        return vectors, paid, any(ended.values()), any(cut.values()), {"success": success}

    def close(self) -> None:
        """Close the environment."""
        self._env.close()


gymnasium.register("Household-v0", entry_point=Household, disable_env_checker=True)
gymnasium.register(
    "HouseholdGoal-v0",
    entry_point=Household,
    disable_env_checker=True,
    kwargs={"goal": True, "keys": ("goal", "messages", "self")},
)


if __name__ == "__main__":
    env: Any = gymnasium.make("Household-v0")
    env.reset(seed=0)
    env.action_space.seed(0)
    total, over, steps = 0.0, False, 0
    while not over:
        _, paid, ended, cut, info = env.step(env.action_space.sample())
        total, over, steps = total + float(np.mean(paid)), ended or cut, steps + 1
    print(f"{steps} steps, return {total:.1f}, success {info['success']:.0f}")
    env.close()
