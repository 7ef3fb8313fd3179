"""The environment in RLlib: PPO with one policy for each robot.

RLlib pins an older gymnasium, so give it an environment of its own:
python -m venv rllib && rllib/bin/pip install "ray[rllib]==2.60" torch -e .
rllib/bin/python examples/rllib_ppo.py --iterations 2
"""

import argparse
from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo.utils import BaseParallelWrapper

import chmarl_pb

try:
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
    from ray.tune.registry import register_env
except ImportError as error:
    raise SystemExit(f"error: this example needs RLlib ({error}); install it as its first lines say") from None


class Flat(BaseParallelWrapper):  # type: ignore[misc]
    """One vector for each robot, as RLlib's default networks want it; ids of words and nodes are scaled to 0..1."""

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the vector's space."""
        return spaces.Box(-1, 1, (spaces.flatdim(self.env.observation_space(agent)),), np.float32)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, ...]:
        """Start an episode."""
        seen, infos = self.env.reset(seed, options)
        return {robot: self._flat(robot, part) for robot, part in seen.items()}, infos

    def step(self, actions: dict[str, Any]) -> tuple[Any, ...]:
        """Let both robots act."""
        seen, *rest = self.env.step(actions)
        return {robot: self._flat(robot, part) for robot, part in seen.items()}, *rest

    def _flat(self, robot: str, seen: dict[str, np.ndarray]) -> np.ndarray:
        parts = self.env.observation_space(robot).items()
        return np.concatenate([(seen[key] / box.high).ravel() for key, box in parts], dtype=np.float32)


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print the mean return."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--iterations", type=int, default=2)
    parser.add_argument("--batch", type=int, default=1_000, help="steps in an iteration")
    options = parser.parse_args(arguments)
    register_env("household", lambda config: ParallelPettingZooEnv(Flat(chmarl_pb.parallel_env(**config))))
    config = PPOConfig().environment("household").env_runners(num_env_runners=0)
    config.training(train_batch_size=options.batch, minibatch_size=min(options.batch, 128))
    config.multi_agent(policies={"humanoid", "drone"}, policy_mapping_fn=lambda agent, *_, **__: agent)
    learner = config.build_algo()
    for number in range(options.iterations):
        print(f"iteration {number}: mean return {learner.train()['env_runners']['episode_return_mean']:.2f}")


if __name__ == "__main__":
    main()
