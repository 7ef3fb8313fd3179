"""``python -m chmarl_pb``: the program ``chmarl-pb``, where its folder is not on the path."""

import sys

from chmarl_pb.cli import main

if __name__ == "__main__":
    sys.exit(main())
