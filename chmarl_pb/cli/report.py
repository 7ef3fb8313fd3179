"""``chmarl-pb report``: gather results into one web page."""

import argparse
from pathlib import Path

from chmarl_pb.cli.arguments import OutputFile
from chmarl_pb.evaluation.report import write_report


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=lambda options: write_report(options.results, options.out))
    parser.add_argument(
        "results", type=Path, nargs="*", default=[Path("out/baselines")], metavar="RESULT.json",
        help="result files or folders of them (default: out/baselines)",
    )  # fmt: skip
    parser.add_argument(
        "--out", type=OutputFile(".html"), default=Path("out/report.html"), metavar="HTML", help="page to write"
    )
