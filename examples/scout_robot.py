"""A robot of one's own, as a URDF and a robot file: a scout on wheels searches with the humanoid.

python examples/scout_robot.py [SEED]
"""

import sys
from pathlib import Path

import cv2
import numpy as np

import chmarl_pb

SCOUT = Path(__file__).parent / "scout" / "scout.toml"


def main(seed: int = 2, out: Path = Path("out/scout.png")) -> None:
    """Print what the scout does and sees, and save both robots' pictures."""
    env = chmarl_pb.parallel_env(robots=("humanoid", SCOUT), split="val-unseen", render_mode="rgb_array")
    print(env.possible_agents, env.action_names["scout"])
    episode = chmarl_pb.rollout(env, chmarl_pb.make_policy("search", env), seed)
    for actions, infos in zip(episode.actions, episode.infos[1:], strict=True):
        action = env.action_names["scout"][actions["scout"]]
        print(f"{action:16} sees {', '.join(infos['scout']['visible'][:4])} ...")
    print("success" if episode.success else "failure", f"after {episode.steps} steps")
    out.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(out), cv2.cvtColor(np.asarray(env.render()), cv2.COLOR_RGB2BGR))
    env.close()


if __name__ == "__main__":
    main(int(sys.argv[1]) if sys.argv[1:] else 2)
