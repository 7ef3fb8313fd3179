"""`python -m training.ours`: our strongest learner. Imitation of the search policy, then MAPPO from there on.

The search policy (chmarl_pb.planner.search) knows no more than the robots see; to imitate it gives a learner that looks
around and goes on, which the privileged planner, who never searches, cannot teach. MAPPO then shortens the search by
the reward. Both steps see graphs pooled by the instruction (:class:`training.graphs.GatedGraphEncoder`).
"""

import argparse
import sys
from functools import partial
from pathlib import Path

import torch

from chmarl_pb.envs.rollout import make_policy
from chmarl_pb.errors import ChmarlError
from training.benchmark import benchmark
from training.config import ImitationConfig, MappoConfig
from training.loop import BEST, train
from training.validation import by_tasks

IMITATION = "imitation"  # folder of the first step in that of the run


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit code."""
    options = _parser().parse_args(arguments)
    torch.set_num_threads(1)
    folder = options.out or Path("out/train") / f"ours-{options.observation}-seed{options.seed}"
    first = ImitationConfig(seed=options.seed, episodes=options.imitation_episodes)
    then = MappoConfig(seed=options.seed, episodes=options.episodes, start=str(folder / IMITATION / BEST))
    try:
        env_fn, setting = benchmark(options.observation, options.messages, options.feedback)
        train(
            env_fn, "imitation", first, folder / IMITATION, by_tasks(), setting, False, partial(make_policy, "search")
        )
        result = train(env_fn, "mappo", then, folder, by_tasks(), setting, False)
    except ChmarlError as error:
        print(f"error: {error}", file=sys.stderr)
        return 1
    print(f"{folder / BEST}: PLW {100 * result.best_score:.1f} on the validation tasks. Evaluate it with")
    print(f"chmarl-pb evaluate --policy {folder / BEST} --split test-unseen --observation {options.observation}")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m training.ours", description=__doc__.split("`: ")[1])
    switch = argparse.BooleanOptionalAction
    parser.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    parser.add_argument("--messages", action=switch, default=True, help="whether the robots hear each other")
    parser.add_argument("--feedback", action=switch, default=True, help="whether they get language feedback")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--imitation-episodes", type=int, default=ImitationConfig().episodes, help="(default %(default)s)"
    )
    parser.add_argument("--episodes", type=int, default=MappoConfig().episodes, help="of MAPPO (default %(default)s)")
    parser.add_argument("--out", type=Path, help="folder of the run; default: out/train/NAME")
    return parser


if __name__ == "__main__":
    raise SystemExit(main())
