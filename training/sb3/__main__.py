"""``python -m training.sb3 --algo ppo``: train a baseline of Stable-Baselines3; the same as ``chmarl-pb sb3``."""

import sys

from chmarl_pb.cli import main

if __name__ == "__main__":
    raise SystemExit(main(["sb3", *sys.argv[1:]]))
