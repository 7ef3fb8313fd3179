"""The command ``chmarl-pb completion``: print a script that completes commands and options in a shell."""

import argparse
from collections.abc import Iterator
from pathlib import Path

from chmarl_pb.cli.arguments import OutputFile, output_folder
from chmarl_pb.extras import needs

SHELLS = ("bash", "zsh", "tcsh")


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=_run)
    parser.add_argument("shell", choices=SHELLS, metavar="SHELL", help=f"one of: {', '.join(SHELLS)}")


def _run(options: argparse.Namespace) -> int:
    """Print the script, which holds all commands and so needs no Python while somebody types."""
    with needs("chmarl-pb completion", "completion"):
        import shtab
    from chmarl_pb.cli.program import COMMANDS, parser_of  # that imports this module only when it is asked for

    parser = parser_of(COMMANDS)
    for one in parsers_in(parser):
        for action in one._actions:
            if action.type is Path or isinstance(action.type, OutputFile):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
            elif action.type is output_folder:
                action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    print(shtab.complete(parser, options.shell))
    return 0


def parsers_in(parser: argparse.ArgumentParser) -> Iterator[argparse.ArgumentParser]:
    """Yield a parser and all parsers of its commands and verbs."""
    yield parser
    for action in parser._actions:
        if isinstance(action, argparse._SubParsersAction):
            for inner in action.choices.values():
                yield from parsers_in(inner)
