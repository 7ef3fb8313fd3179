"""``python -m training.train --algo qmix``: train a learner; the same as ``chmarl-pb train``."""

import sys

from chmarl_pb.cli import main

if __name__ == "__main__":
    raise SystemExit(main(["train", *sys.argv[1:]]))
