"""``python -m chmarl_pb.cli``: the same as ``chmarl-pb``."""

from chmarl_pb.cli.program import main

if __name__ == "__main__":
    raise SystemExit(main())
