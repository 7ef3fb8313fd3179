"""Load a checkpoint, play one task with it, and watch: what the robots do, and what they see as an animated GIF.

python examples/watch_checkpoint.py out/train/qmix-scene_graph-messages-feedback-seed0/best.pt --task val-unseen-000
"""

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

import chmarl_pb
from chmarl_pb.extras import needs

with needs("this example", "train", script=True):
    from chmarl_pb.learning.policies.load import load_policy


def main(arguments: Sequence[str] | None = None) -> None:
    """Play, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("checkpoint", type=Path)
    parser.add_argument("--task", help="default: the first on which weights are chosen")
    parser.add_argument("--observation", default="scene_graph", help="as the checkpoint was trained")
    parser.add_argument("--out", type=Path, default=Path("out/episode.gif"))
    options = parser.parse_args(arguments)

    policies = load_policy(options.checkpoint)
    rules = getattr(policies, "rules", {})  # that it was trained by; clones have those of their data
    env = chmarl_pb.parallel_env(options.observation, render_mode="rgb_array", **rules)
    policy = policies(env)
    task = options.task or ("generated-val-000" if "track" in rules else "val-unseen-000")
    observations, infos = env.reset(seed=0, options={"task": task})
    policy.reset(0)
    print(env.instruction)
    frames = [Image.fromarray(np.asarray(env.render()))]
    while env.agents:
        actions = policy.act(observations, infos)
        observations, _, _, _, infos = env.step(actions)
        moves = {robot: int(np.ravel(action)[0]) for robot, action in actions.items()}  # own words come behind
        names = "".join(f"{env.action_names[robot][move]:17}" for robot, move in moves.items())
        print(f"{env.steps:2}  {names}phi {env.outcome.potential:g}")
        frames.append(Image.fromarray(np.asarray(env.render())))
    print(
        "success" if env.outcome.success else "failure",
        f"after {env.steps} steps, L* {env.task.optimal_steps}",
    )
    options.out.parent.mkdir(parents=True, exist_ok=True)
    frames[0].save(options.out, save_all=True, append_images=frames[1:], duration=400, loop=0)
    env.close()


if __name__ == "__main__":
    main()
