"""``chmarl-pb``: one file a command, a thin face over the package."""

from chmarl_pb.cli.program import main

__all__ = ["main"]
