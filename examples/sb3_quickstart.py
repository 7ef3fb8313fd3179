"""PPO of Stable-Baselines3 learns to find and bring things: python examples/sb3_quickstart.py [STEPS [SEED]]."""

import sys  # noqa: I001
from typing import Any

import chmarl_pb
from chmarl_pb.learning.sb3 import GoalFeatures, policy_of  # first, as it says how to install what is missing

from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize


def main(steps: int = 200_000, seed: int = 0) -> None:
    """Train the humanoid, while the drone searches; print how often it succeeds on tasks that it has not seen."""
    env = VecNormalize(chmarl_pb.sb3_vec_env(16, "CHMARL/SceneGraphHumanoid-v0", goal=True), norm_obs=False, gamma=0.97)
    network = {"features_extractor_class": GoalFeatures, "net_arch": [64]}
    settings: dict[str, Any] = {"n_steps": 64, "batch_size": 128, "learning_rate": 7e-4, "gamma": 0.97}
    settings |= {"ent_coef": 0.015, "policy_kwargs": network, "seed": seed, "device": "cpu", "verbose": 1}
    model = PPO("MultiInputPolicy", env, **settings)
    model.learn(steps, log_interval=10)
    for split in ("val-seen", "val-unseen"):
        report = chmarl_pb.evaluate(policy_of(model), split, seeds=[0], workers=1, goal=True)
        print(f"{split}: {report.success_rate:.0%} of {len(report.episodes)} tasks, PLW {report.plw:.0%}")


if __name__ == "__main__":  # the environments' processes import this file
    main(*map(int, sys.argv[1:]))
