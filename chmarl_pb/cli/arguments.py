"""Arguments that several commands share."""

import argparse
from pathlib import Path

from chmarl_pb.catalog import Catalog
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.tracks import PAPER, TRACKS
from chmarl_pb.robots.registry import TEAM, listed

OBSERVATIONS = ("scene_graph", "visual")
GOAL = "observe the class ids of what the instruction asks for, and whether it is in view, as policies may need"


def verbs(parser: argparse.ArgumentParser) -> "argparse._SubParsersAction[argparse.ArgumentParser]":
    """Return what takes the verbs of a command, e.g. "check" of ``homes``."""
    return parser.add_subparsers(required=True, metavar="VERB")


def add_verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str
) -> argparse.ArgumentParser:
    """Add a verb to a command and return its parser."""
    parser: argparse.ArgumentParser = verbs.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    return parser


def add_robots(parser: argparse.ArgumentParser) -> None:
    """Add the option that names the robots."""
    parser.add_argument(
        "--robots", type=listed, default=TEAM, metavar="R,R",
        help=f"1 to 8 robots: names or robot files (.toml), with commas between them (default: {','.join(TEAM)})",
    )  # fmt: skip


def add_track(parser: argparse.ArgumentParser) -> None:
    """Add the option that names the track."""
    parser.add_argument("--track", choices=tuple(TRACKS), default=PAPER, help="rules (default: paper)")


def add_home(parser: argparse.ArgumentParser, what: str) -> None:
    """Add the option that names a home, and what follows from it."""
    parser.add_argument("--home", metavar="H", help=f"play in this home, a name or a URDF: {what}")


def add_catalog(parser: argparse.ArgumentParser) -> None:
    """Add the option that names a catalogue file."""
    parser.add_argument(
        "--catalog", metavar="TOML", help="catalogue file of own things (default: the one that CHMARL_CATALOG names)"
    )


def catalog_of(path: str | None) -> Catalog:
    """Return the classes of things that --catalog means.

    Raises:
        AssetError: the file cannot be used.
    """
    return Options(catalog=path).things


def output_file(text: str) -> Path:
    """Return the path of a file to write, or say at once why nothing can be written there."""
    return _writable(Path(text), Path(text).is_dir(), "is a folder; name a file in it")


def output_folder(text: str) -> Path:
    """Return the path of a folder to write to, or say at once why nothing can be written there."""
    return _writable(Path(text), Path(text).is_file(), "is a file; name a folder")


def _writable(path: Path, wrong: bool, words: str) -> Path:
    if wrong:
        raise argparse.ArgumentTypeError(f"{path} {words}")
    for parent in path.parents:
        if parent.is_file():
            raise argparse.ArgumentTypeError(f"{parent} is a file; name a folder")
    return path
