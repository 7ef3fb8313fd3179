"""Arguments that several commands share."""

import argparse
import os
from collections.abc import Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chmarl_pb.catalog import Catalog
from chmarl_pb.envs.options import SENSORS, SYMBOLS, Options
from chmarl_pb.envs.tracks import OF_TRACK, PAPER, TRACKS
from chmarl_pb.errors import OptionError
from chmarl_pb.executors import Executor, started
from chmarl_pb.files import check_apart
from chmarl_pb.limits import whole_number
from chmarl_pb.robots.registry import TEAM, listed
from chmarl_pb.tasks.language.templates import REVISIONS

EXAMPLE = "example: "
STDOUT = "-"
GOAL = "observe the class ids of what the instruction asks for, and whether it is in view, as policies may need"
WORKERS = 2
SEEDS = 3

#: Options that name what is read, one thing or several, and those that name what is written.
_INPUTS = ("home", "catalog", "policy", "env", "robots", "fill", "file", "layout", "results", "against")
_OUTPUTS = ("out", "json", "preview", "record")


def verbs(parser: argparse.ArgumentParser) -> "argparse._SubParsersAction[argparse.ArgumentParser]":
    """Return what takes the verbs of a command, e.g. "check" of ``homes``."""
    return parser.add_subparsers(required=True, metavar="VERB")


def add_verb(
    verbs: "argparse._SubParsersAction[argparse.ArgumentParser]", name: str, text: str, example: str
) -> argparse.ArgumentParser:
    """Add a verb to a command, or a command to the program, and return its parser.

    Args:
        verbs: where it is added.
        name: its name.
        text: what it does.
        example: of its use, shown below its options; "" if it has verbs of its own, which show theirs.
    """
    parser: argparse.ArgumentParser = verbs.add_parser(
        name, help=text, description=text[0].upper() + text[1:] + ".", epilog=f"{EXAMPLE}{example}" if example else None
    )
    if example:
        parser.add_argument("--quiet", action="store_true", help="no progress bars, no notes: results and errors alone")
    return parser


def add_robots(parser: argparse.ArgumentParser) -> None:
    """Add the option that names the robots."""
    parser.add_argument(
        "--robots", type=listed, default=TEAM, metavar="R,R",
        help=f"1 to 8 robots: names or robot files (.toml), with commas between them (default: {','.join(TEAM)})",
    )  # fmt: skip


def add_track(parser: argparse.ArgumentParser, default: str = PAPER, text: str = "paper") -> None:
    """Add the option that names the track; ``text`` says what its default is."""
    parser.add_argument("--track", choices=tuple(TRACKS), default=default, help=f"rules (default: {text})")


def add_lookalikes(parser: argparse.ArgumentParser) -> None:
    """Add the option that puts other objects of X's class into the home."""
    parser.add_argument(
        "--lookalikes", action=argparse.BooleanOptionalAction, default=OF_TRACK,
        help="other objects of X's class stand there; the instruction names X's colour and Y's room",
    )  # fmt: skip


def add_messages(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what robots hear of each other."""
    words = parser.add_mutually_exclusive_group()
    for flag, value, text in (
        ("--messages", True, "the message board (default of the track paper)"),
        ("--no-messages", False, "messages read as zeros"),
        ("--symbols", SYMBOLS, "no board; robots have own words (default of the track grounded)"),
    ):
        words.add_argument(flag, dest="messages", action="store_const", const=value, default=OF_TRACK, help=text)


def add_max_steps(parser: argparse.ArgumentParser) -> None:
    """Add the option that limits an episode."""
    parser.add_argument(
        "--max-steps", type=int, default=OF_TRACK, metavar="N", help="joint steps in an episode (default: the track's)"
    )


def add_rules(parser: argparse.ArgumentParser, default: str = PAPER, text: str = "paper") -> None:
    """Add the options that name the track, with its default and what is said of that, and its rules one by one."""
    add_track(parser, default, text)
    add_messages(parser)
    told = parser.add_mutually_exclusive_group()
    told.add_argument(
        "--feedback", nargs="?", const=True, choices=("paper", "planner"), default=OF_TRACK,
        help="style of the language feedback; without a value: paper (default: paper; grounded: none)",
    )  # fmt: skip
    told.add_argument(
        "--no-feedback", dest="feedback", action="store_const", const=False, default=OF_TRACK,
        help="no language feedback",
    )  # fmt: skip
    parser.add_argument(
        "--pointing", action=argparse.BooleanOptionalAction, default=OF_TRACK,
        help="Pick and Place name a cell of the robot's picture (default: in the track grounded)",
    )  # fmt: skip
    add_lookalikes(parser)
    parser.add_argument(
        "--templates", type=int, choices=REVISIONS, default=OF_TRACK, help="2: mended sentences (default of grounded)"
    )
    add_max_steps(parser)


def given_rules(options: argparse.Namespace) -> dict[str, Any]:
    """Return the options of the environment that ``add_rules`` has added and that were given."""
    names = ("track", "messages", "feedback", "pointing", "lookalikes", "templates", "max_steps")
    return {name: value for name in names if (value := getattr(options, name)) is not OF_TRACK}


def add_observation(parser: argparse.ArgumentParser) -> None:
    """Add the option that names what policies observe; published weights know it."""
    parser.add_argument(
        "--observation", metavar="O",
        help=f"{', '.join(SENSORS)}, or several joined by + (default: that of published weights, else scene_graph)",
    )  # fmt: skip


def given_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return --goal, --robots and --catalog where they are given, as options of the environment."""
    given = {"goal": options.goal, "robots": options.robots, "catalog": options.catalog}
    return {name: value for name, value in given.items() if value not in (False, None, TEAM)}


def add_played(parser: argparse.ArgumentParser) -> None:
    """Add the options that say what is played, how often and by how many processes."""
    parser.add_argument(
        "--split", default=OF_TRACK, metavar="S", help="split (default: test-unseen; grounded: generated-test)"
    )
    add_observation(parser)
    add_seeds(parser)
    add_workers(parser)


_MOST_SEEDS = 10_000


def add_seeds(parser: argparse.ArgumentParser) -> None:
    """Add the option that says how often all tasks are played."""
    parser.add_argument("--seeds", type=int, default=SEEDS, metavar="K", help="seeds 0 to K - 1 (default: %(default)s)")


def chosen_seeds(options: argparse.Namespace) -> range:
    """Return the seeds that --seeds means.

    Raises:
        OptionError: there is none, or more than a machine can play.
    """
    return range(whole_number("seeds", options.seeds, 1, _MOST_SEEDS))


def add_workers(parser: argparse.ArgumentParser) -> None:
    """Add the options that say who does the work."""
    parser.add_argument("--workers", type=int, default=WORKERS, metavar="N", help="processes (default: %(default)s)")
    parser.add_argument(
        "--ray", metavar="ADDRESS",
        help="do the work on a Ray cluster: HOST:PORT of its head, auto for the one on this machine, or local; "
        "needs the extra scale",
    )  # fmt: skip


def chosen_executor(options: argparse.Namespace) -> AbstractContextManager[Executor]:
    """Return who does the work, once entered; the own files that the options name are shipped to a cluster.

    Raises:
        OptionError: the number of workers is less than one or is given for a cluster, or no cluster answers.
        MissingExtraError: Ray is asked for and not installed.
    """
    if options.ray is not None:
        check_used(options, {"workers": WORKERS}, "is for this machine alone, not for --ray")
    return started(options.workers, options.ray, own_files(vars(options)))


def own_files(options: Mapping[str, Any]) -> list[Path]:
    """Return the files of the user's that options name: homes, catalogues, robots, checkpoints, modules, results."""
    named = (options.get(name) or () for name in _INPUTS)
    texts = [str(one) for value in named for one in ([value] if isinstance(value, str | Path) else value)]
    modules = [text.partition(":")[0].partition(".")[0] for text in texts if ":" in text]
    candidates = [*texts, *modules, *(f"{module}.py" for module in modules)]
    return [Path(name) for name in candidates if os.path.exists(name)]


def check_outputs(options: argparse.Namespace) -> None:
    """Refuse to write over a file that a command reads, and to write two results into one file.

    Raises:
        OptionError: an option names such a file.
    """
    named = {name: getattr(options, name, None) for name in _OUTPUTS}
    outputs = {f"--{name}": Path(value) for name, value in named.items() if value not in (None, STDOUT)}
    sources, places = own_files(vars(options)), dict[str, str]()
    for option, path in outputs.items():
        check_apart(path, sources)
        other = places.setdefault(os.path.realpath(path), option)
        if other != option and not path.is_dir():
            raise OptionError(f"{path}: {other} and {option} both write it; name another file")


def check_used(options: argparse.Namespace, unused: Mapping[str, Any], reason: str) -> None:
    """Refuse options that would change nothing.

    Args:
        options: that are given.
        unused: name -> default, of those that have no effect now.
        reason: why, for the message.

    Raises:
        OptionError: one of them is given.
    """
    for name, default in unused.items():
        if getattr(options, name) != default:
            raise OptionError(f"--{name.replace('_', '-')} {reason}; leave it out")


def check_home(options: argparse.Namespace) -> None:
    """Refuse --home beside --task.

    Raises:
        OptionError: both are given.
    """
    if options.home is not None and options.task is not None:
        raise OptionError("--task names its home already; leave out --home")


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


@dataclass(frozen=True)
class OutputFile:
    """Reads the path of a file to write, or says at once why nothing can be written there.

    Attributes:
        ending: of its name; "": any.
    """

    ending: str = ""

    def __call__(self, text: str) -> Path:
        """Return the path."""
        path = _writable(Path(text), Path(text).is_dir(), "is a folder; name a file in it")
        is_device = path.exists() and not path.is_file()  # as /dev/null
        if self.ending and path.suffix.lower() != self.ending and not is_device:
            raise argparse.ArgumentTypeError(f"{path}: let the file's name end in {self.ending}")
        return path


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
