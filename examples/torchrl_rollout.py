"""The environment in TorchRL: one random episode as a TensorDict (pip install torchrl).

python examples/torchrl_rollout.py --steps 28
"""

import argparse
from collections.abc import Sequence

import chmarl_pb

try:
    from torchrl.envs.libs.pettingzoo import PettingZooWrapper
except ImportError as error:
    raise SystemExit(f"error: this example needs TorchRL ({error}); run `pip install torchrl`") from None


def main(arguments: Sequence[str] | None = None) -> None:
    """Play at random, and print what each robot observed and was paid."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--observation", default="scene_graph", choices=("scene_graph", "visual"))
    parser.add_argument("--split", default="train")
    parser.add_argument("--steps", type=int, default=28)
    options = parser.parse_args(arguments)
    plain = chmarl_pb.parallel_env(options.observation, split=options.split, max_steps=options.steps)
    inner = chmarl_pb.NumericInfos(plain)  # TorchRL makes tensors of infos, so they may hold no text
    # The robots differ in their actions, so each is a group of its own; those of `flat_env` can be one group.
    groups = {robot: [robot] for robot in inner.possible_agents}
    env = PettingZooWrapper(inner, group_map=groups, seed=0)
    try:
        episode = env.rollout(options.steps)
        for robot in groups:
            shapes = {key: tuple(value.shape[2:]) for key, value in episode[robot, "observation"].items()}
            print(f"{robot}: {len(episode)} steps, return {episode['next', robot, 'reward'].sum():.1f}, {shapes}")
    finally:
        env.close()


if __name__ == "__main__":
    main()
