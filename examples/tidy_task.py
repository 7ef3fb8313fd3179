"""Two objects, each to be brought to where it belongs, or more: the planner tidies up.

python examples/tidy_task.py [SEED [OBJECTS]]
"""

import sys

import chmarl_pb
from chmarl_pb.tasks.kinds import Tidy


def main(seed: int = 1, objects: int = 2) -> None:
    """Draw a task, and print what is done and how the potential grows."""
    kind = Tidy(fewest=objects, most=objects)  # "tidy": 2 to 5 objects
    env = chmarl_pb.parallel_env(task=kind, split="val-unseen", max_steps=60)
    env.reset(seed=seed)
    print(env.instruction)
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("planner", env), seed, env.task)
    for actions, infos in zip(episode.actions, episode.infos[1:], strict=True):
        print(f"{env.action_names['humanoid'][actions['humanoid']]:16} {infos['humanoid']['potential']:g}")
    print("success" if episode.success else "failure", f"after {episode.steps} steps, L* {episode.task.optimal_steps}")
    env.close()


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
