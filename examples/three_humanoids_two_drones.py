"""A larger team: three humanoids tidy up, two drones search.

python examples/three_humanoids_two_drones.py [SEED]
"""

import sys

import chmarl_pb


def main(seed: int = 0) -> None:
    """Play a tidy task by the planner, and print what each robot does."""
    robots = ("humanoid", "humanoid", "humanoid", "drone", "drone")
    env = chmarl_pb.parallel_env(robots=robots, task="tidy", split="val-unseen", max_steps=60)
    env.reset(seed=seed)
    print(env.instruction)
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed, env.task)
    print("  ".join(f"{agent:16}" for agent in env.possible_agents))
    for actions in episode.actions:
        print("  ".join(f"{env.action_names[agent][number]:16}" for agent, number in actions.items()))
    print("success" if episode.success else "failure", f"after {episode.steps} steps")
    env.close()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
