"""The command ``chmarl-pb watch``: let a policy that is there already play a task, and show it. Nothing is trained."""

import argparse
from pathlib import Path

from chmarl_pb.cli.arguments import check_home, check_used, output_folder
from chmarl_pb.cli.demo import show_episode
from chmarl_pb.cli.episode import write_page
from chmarl_pb.cli.play import PAGE, add_page, serve
from chmarl_pb.cli.playing import add_playing, observation_of, played, rules_for, task_of
from chmarl_pb.envs.tracks import OF_TRACK, PAPER
from chmarl_pb.extras import check
from chmarl_pb.files import open_folder
from chmarl_pb.viewer.record import choose_task
from chmarl_pb.viewer.studio import compiling

_NAME = "watch"  # of the files
_OUT = Path("out")
_ALONE = {"out": _OUT, "seed": 0}  # options with their defaults that a live page does not have


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=_run)
    parser.add_argument(
        "policy", metavar="POLICY", help="published weights, a built-in policy, a checkpoint's path or module:callable"
    )
    add_playing(parser)
    shown = parser.add_mutually_exclusive_group()
    shown.add_argument("--page", action="store_true", help="a page in 3D instead of the video (extra viewer)")
    shown.add_argument("--live", action="store_true", help="in the browser, as chmarl-pb play (extra viewer)")
    parser.add_argument(
        "--out", type=output_folder, default=_OUT, metavar="DIR", help="folder to write to (default: out)"
    )
    add_page(parser)


def _run(options: argparse.Namespace) -> int:
    """Play the task and show the episode as it is asked for; return the exit code."""
    check_home(options)
    check_used(options, *((_ALONE, "has no effect with --live") if options.live else (PAGE, "is for --live")))
    if options.page or options.live:
        check(f"chmarl-pb watch --{'page' if options.page else 'live'}", "viewer", "viser")
    if options.live:
        return _live(options)
    folder = open_folder(options.out)
    task = choose_task() if options.task is None and options.home is None else task_of(options)
    with compiling():
        file, _ = played(options, task)
    if options.page:
        return write_page(file, folder / f"{_NAME}.html")
    return show_episode(file, folder, name=_NAME)


def _live(options: argparse.Namespace) -> int:
    """Serve the page in which the policy drives all robots."""
    from chmarl_pb.viewer.live.choice import Choice

    rules = rules_for(options)
    own = ("track", "messages", "max_steps", "robots", "catalog")
    choice = Choice(
        options.task, options.home, 0, rules.get("track", PAPER), rules.get("messages", OF_TRACK),
        rules.get("max_steps", OF_TRACK), observation_of(options), options.robots, options.catalog,
        {name: value for name, value in rules.items() if name not in own},
    )  # fmt: skip
    return serve(choice, [options.policy], options, options.policy)
