"""The flat view in RLlib: PPO with its default encoder, and one policy for each robot or one for both.

RLlib pins an older gymnasium, so give it an environment of its own:
python -m venv rllib && rllib/bin/pip install "ray[rllib]==2.60" torch -e .
rllib/bin/python examples/rllib_ppo.py --iterations 2 --shared
"""

import argparse
from collections.abc import Sequence

import chmarl_pb

try:
    from ray.rllib.algorithms.ppo import PPOConfig
    from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
    from ray.tune.registry import register_env
except ImportError as error:
    raise SystemExit(f"error: this example needs RLlib ({error}); install it as its first lines say") from None


def main(arguments: Sequence[str] | None = None) -> None:
    """Train, and print the mean return."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--iterations", type=int, default=2)
    parser.add_argument("--batch", type=int, default=1_000, help="steps in an iteration")
    parser.add_argument("--shared", action="store_true", help="one policy for both robots")
    options = parser.parse_args(arguments)
    register_env("household", lambda config: ParallelPettingZooEnv(chmarl_pb.flat_env(**config)))
    config = PPOConfig().environment("household").env_runners(num_env_runners=0)
    config.training(train_batch_size=options.batch, minibatch_size=min(options.batch, 128))
    policies = {"both"} if options.shared else {"humanoid", "drone"}
    config.multi_agent(policies=policies, policy_mapping_fn=lambda agent, *_, **__: "both" if options.shared else agent)
    learner = config.build_algo()
    for number in range(options.iterations):
        print(f"iteration {number}: mean return {learner.train()['env_runners']['episode_return_mean']:.2f}")


if __name__ == "__main__":
    main()
