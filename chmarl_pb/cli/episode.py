"""The commands ``chmarl-pb episode save | replay | show | page``."""

import argparse
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import chmarl_pb
from chmarl_pb.cli.arguments import (
    STDOUT,
    OutputFile,
    add_verb,
    output_folder,
    verbs,
)
from chmarl_pb.cli.demo import show_episode
from chmarl_pb.cli.output import add_json, has, tell
from chmarl_pb.cli.playing import add_playing, played, task_of
from chmarl_pb.errors import ActionError, OptionError, ResultError
from chmarl_pb.evaluation.episode_file import FORMAT, EpisodeFile, load_episode, replay_episode, save_episode
from chmarl_pb.evaluation.json_file import check_replaceable
from chmarl_pb.extras import check
from chmarl_pb.files import write_atomically
from chmarl_pb.viewer.record import record_file


def add(parser: argparse.ArgumentParser) -> None:
    """Add the verbs to a parser."""
    all_verbs = verbs(parser)
    saving = add_verb(
        all_verbs,
        "save",
        "play a task with a policy and save the episode as a file",
        "chmarl-pb episode save --policy search --task test-unseen-007 --out episode.json",
    )
    saving.set_defaults(run=save)
    saving.add_argument("--policy", default="planner", metavar="P", help="as for evaluate (default: planner)")
    add_playing(saving)
    saving.add_argument("--out", type=OutputFile(".json"), required=True, metavar="FILE", help="file to write")
    replaying = add_verb(
        all_verbs, "replay", "play a file again and compare every state", "chmarl-pb episode replay episode.json"
    )
    replaying.set_defaults(run=replay)
    add_json(replaying, has("file", "same", "success", "steps"))
    showing = add_verb(
        all_verbs,
        "show",
        "make the demo's video and page of an episode file",
        "chmarl-pb episode show episode.json --page",
    )
    showing.set_defaults(run=lambda options: _show(options.file, options.out, not options.page))
    showing.add_argument("--page", action="store_true", help="the page alone, without a video")
    paging = add_verb(
        all_verbs,
        "page",
        "make a page that plays an episode file in 3D, without a server or a network",
        "chmarl-pb episode page episode.json --out episode.html",
    )
    paging.set_defaults(run=page)
    paging.add_argument(
        "--out", type=OutputFile(".html"), default=Path("episode.html"), metavar="FILE",
        help="file to write (default: episode.html)",
    )  # fmt: skip
    for verb in (replaying, showing, paging):
        verb.add_argument("file", type=Path, metavar="FILE", help="episode file")
    showing.add_argument(
        "--out", type=output_folder, default=Path("out"), metavar="DIR", help="folder to write to (default: out)"
    )


def save(options: argparse.Namespace) -> int:
    """Play a task as an evaluation with this seed does, and save the episode; return the exit code."""
    if (options.task is None) == (options.home is None):
        raise OptionError("give either --task, which names its home, or --home, for which a task is drawn")
    check_replaceable(options.out, FORMAT, "an episode file")
    file, shortest = played(options, task_of(options))
    save_episode(file, options.out)
    print(f"{options.out}: {'success' if file.success else 'failure'} after {len(file.actions)} steps, L* {shortest}")
    return 0


def replay(options: argparse.Namespace) -> int:
    """Play an episode file again; return 0 if every state is the same, else 1."""
    path = options.file
    file = load_episode(path)
    if file.library != chmarl_pb.__version__:
        print(f"{path}: saved by version {file.library}, replayed by {chmarl_pb.__version__}", file=sys.stderr)
    with _playing(path):
        difference = replay_episode(file)
    facts = {"file": str(path), "same": difference is None, "success": file.success, "steps": len(file.actions)}
    tell(options, lambda: facts, lambda: None)
    if difference is not None:
        print(f"{path}: {difference}", file=sys.stderr)
        return 1
    ending = "success" if file.success else "failure"
    if options.json != STDOUT:
        print(f"{path}: all {len(file.states)} states are the same; {ending} after {len(file.actions)} steps")
    return 0


def page(options: argparse.Namespace) -> int:
    """Write the replay page of an episode file; return the exit code."""
    check("chmarl-pb episode page", "viewer", "viser")
    with _playing(options.file):
        return write_page(load_episode(options.file), options.out)


def _show(path: Path, out: Path, film: bool) -> int:
    with _playing(path):
        return show_episode(load_episode(path), out, film=film)


@contextmanager
def _playing(path: Path) -> Iterator[None]:
    """Name the file if its actions cannot be taken.

    Raises:
        ResultError: so it is.
    """
    try:
        yield
    except ActionError as error:
        raise ResultError(f"{path}: {error}; save the episode again") from error


def write_page(file: EpisodeFile, out: Path) -> int:
    """Write the replay page of an episode; return the exit code."""
    from chmarl_pb.viewer.live.replay_page import replay_page

    write_atomically(out, replay_page(record_file(file)))
    print(out)
    return 0
