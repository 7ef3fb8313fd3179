"""``chmarl-pb tasks build``: make the benchmark's task files."""

import argparse

from chmarl_pb.cli.arguments import add_verb, output_folder, verbs
from chmarl_pb.data.build_tasks import build_all


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verb to a parser."""
    build = add_verb(
        verbs(parser),
        "build",
        "draw and solve the tasks of all splits",
        "chmarl-pb tasks build --out out/tasks --workers 4",
    )
    build.set_defaults(run=lambda options: build_all(options.out, options.workers))
    build.add_argument("--out", type=output_folder, required=True, metavar="DIR", help="folder for the CSV files")
    build.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
