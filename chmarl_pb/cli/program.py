"""The program ``chmarl-pb``: finds the command, runs it, and turns its errors into one line and an exit code."""

import argparse
import io
import os
import signal
import sys
from collections.abc import Collection, Sequence
from contextlib import nullcontext
from importlib import import_module

from chmarl_pb import __version__
from chmarl_pb.errors import ChmarlError
from chmarl_pb.signals import Interrupted, ended_by, handled, loading, reader_gone

PROGRAM = "chmarl-pb"

#: Command -> what it does, and an example; those without one have verbs with examples. Its module, of the same name in
#: this package, is imported when it is asked for: ``add`` puts its options into a parser, with the function that runs
#: it as the default of ``run``.
COMMANDS = {
    "demo": ("let the planner solve a task, as a video and a page", "chmarl-pb demo --task test-unseen-007"),
    "play": (
        "drive the robots in the browser, or hand them to policies",
        "chmarl-pb play --task test-unseen-007 --policy runs/qmix/best.pt",
    ),
    "watch": (
        "let a policy play a task and show it as a video, as a page or in the browser",
        "chmarl-pb watch search --task test-unseen-007",
    ),
    "homes": ("list, check, draw, build and generate homes", ""),
    "things": ("import, list and check own objects and furniture", ""),
    "tasks": ("make the benchmark's task files", ""),
    "dataset": ("make, verify and describe data sets of planner trajectories", ""),
    "evaluate": (
        "play all tasks of a split with a policy and print its metrics",
        "chmarl-pb evaluate --policy search --split val-unseen --out search.json",
    ),
    "audit": (
        "measure how much of the score needs neither eyes nor words nor the partner",
        "chmarl-pb audit --track grounded --split generated-val --seeds 1",
    ),
    "baselines": (
        "evaluate the built-in policies on all splits and print the tables",
        "chmarl-pb baselines --policy search --policy belief --split val-unseen",
    ),
    "report": (
        "gather results into one web page, beside the paper's",
        "chmarl-pb report out/baselines search.json --out report.html",
    ),
    "episode": ("save, replay and show single episodes", ""),
    "bench": ("measure the speed on this machine", "chmarl-pb bench --only pointing --json bench.json"),
    "doctor": (
        "show versions and caches, and test whether this machine gives the known results",
        "chmarl-pb doctor --against digests_of_another_machine.json",
    ),
    "completion": ("print a script that completes commands and options in a shell", "chmarl-pb completion bash"),
    "cache": (
        "show, clear or fill the pictures of homes that are kept on disk",
        "chmarl-pb cache --fill home_6 home_7 --workers 2",
    ),
}

#: Learners have commands of their own; their modules have a ``main``. They need the extra ``train``.
LEARNERS = {
    "train": "train a learner of this package on the benchmark",
    "sb3": "train a baseline of Stable-Baselines3",
}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 on success, 1 if a check failed, 2 on bad input, 128 + N when stopped by the signal N."""
    _secure_streams()
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        return _learn(given[0], given[1:]) if given and given[0] in LEARNERS else _run(given)
    except ChmarlError as error:
        return _failed(str(error), 2)
    except BrokenPipeError:
        return reader_gone()
    except OSError as error:
        if error.filename is None:
            return _failed(f"the output cannot be written: {error.strerror or error}", 2)
        return _failed(f"{error.filename}: {error.strerror}; choose another file or folder", 2)
    except KeyboardInterrupt as error:
        number = error.number if isinstance(error, Interrupted) else signal.SIGINT
        return _failed(ended_by(number), 128 + number)


def _secure_streams() -> None:
    """Let printing do no harm: where the output is closed it is lost; what cannot be encoded is shown by escapes."""
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:  # closed: the next file that is opened would take its place
            os.open(os.devnull, os.O_RDWR)
    sys.stdout = sys.stdout or open(os.devnull, "w", encoding="utf-8")
    sys.stderr = sys.stderr or open(os.devnull, "w", encoding="utf-8")
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _failed(message: str, code: int) -> int:
    """Print why a command ends, and return its exit code."""
    print(f"{PROGRAM}: {message}", file=sys.stderr)
    return code


def _run(given: Sequence[str]) -> int:
    with loading(PROGRAM):
        from chmarl_pb.cli.arguments import STDOUT, check_outputs
        from chmarl_pb.cli.output import check_json
        from chmarl_pb.progress import silence

        parser = parser_of(given)
    with handled():
        options = parser.parse_args(given)
        check_outputs(options)
        check_json(options)
        quiet = options.quiet or getattr(options, "json", None) == STDOUT
        with silence() if quiet else nullcontext():
            code = int(options.run(options))
            sys.stdout.flush()
        return code


def _learn(command: str, arguments: Sequence[str]) -> int:
    if (
        "torch" not in sys.modules and "--quiet" not in arguments
    ):  # which takes seconds, on a busy machine or from a cold disk many
        print(f"{PROGRAM} {command}: loading PyTorch", file=sys.stderr, flush=True)
    with loading(PROGRAM):
        module = import_module(f"chmarl_pb.cli.{command}")
    return int(module.main(arguments))


def parser_of(given: Collection[str]) -> argparse.ArgumentParser:
    """Return a parser that knows the options of the commands that are given."""
    from chmarl_pb.cli.arguments import add_verb  # here, as it takes long: main() has to be there first

    parser = argparse.ArgumentParser(prog=PROGRAM, description="Cooperative robots in homes, on PyBullet.")
    parser.add_argument("--version", action="version", version=__version__)
    parsers = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, (text, example) in COMMANDS.items():
        command = add_verb(parsers, name, text, example)
        if name in given:
            import_module(f"chmarl_pb.cli.{name}").add(command)
    for name, text in LEARNERS.items():
        parsers.add_parser(name, help=text)
    return parser
