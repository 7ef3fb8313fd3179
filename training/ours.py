"""`python -m training.ours`: our strongest learner. Imitation of the search policy, then MAPPO from there on.

The search policy knows no more than the robots see; to imitate it gives a learner that looks
around and goes on, which the privileged planner, who never searches, cannot teach. MAPPO then improves the imitator by
the reward. Both steps see graphs pooled by the instruction, and of pictures what a frozen detector finds in them
(:mod:`chmarl_pb.learning.networks`).
"""

import argparse
from pathlib import Path

from chmarl_pb.cli.train import main as train_command
from chmarl_pb.learning.config import ImitationConfig, MappoConfig
from chmarl_pb.learning.runs.loop import BEST

IMITATION = "imitation"  # folder of the first step in that of the run


def main(arguments: list[str] | None = None) -> int:
    """Run `python -m training.train` twice; return its exit code."""
    parser = _parser()
    options = parser.parse_args(arguments)
    for name in ("imitation_episodes", "episodes"):  # of both steps, before the first
        if (value := getattr(options, name)) < 1:
            parser.error(f"--{name.replace('_', '-')} {value}: use at least 1")
    folder = options.out or Path("out/train") / f"ours-{options.observation}-seed{options.seed}"
    shared = ["--observation", options.observation, "--seed", str(options.seed), "--image-encoder", "detector"]
    shared += [
        f"--{'' if on else 'no-'}{name}" for name, on in vars(options).items() if name in ("messages", "feedback")
    ]
    first = ["--algo", "imitation", "--episodes", str(options.imitation_episodes), "--out", str(folder / IMITATION)]
    start = ["--start", str(folder / IMITATION / BEST)]
    then = ["--algo", "mappo", "--episodes", str(options.episodes), *start, "--out", str(folder)]
    return train_command(first + shared) or train_command(then + shared)


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
