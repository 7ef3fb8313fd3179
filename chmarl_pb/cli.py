"""``chmarl-pb``: a thin face over the package."""

import argparse
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from types import FrameType

from chmarl_pb import __version__, commands
from chmarl_pb.errors import ChmarlError

Command = Callable[[argparse.Namespace], int]

_GOAL = "observe the class ids of what the instruction asks for, and whether it is in view, as policies may need"


class Stopped(KeyboardInterrupt):
    """A signal asks this process to end; its argument is the signal's number."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 on success, 1 if a check failed, 2 on bad input, 128 + N when stopped by the signal N."""
    options = _parser().parse_args(arguments)
    try:
        with _stopped_by_signals():
            code = int(options.run(options))
            sys.stdout.flush()
        return code
    except ChmarlError as error:
        return _failed(str(error), 2)
    except OSError as error:
        if error.filename is None:
            return _failed(f"the output cannot be written: {error.strerror or error}", 2)
        return _failed(f"{error.filename}: {error.strerror}; choose another file or folder", 2)
    except KeyboardInterrupt as error:
        number = error.args[0] if isinstance(error, Stopped) else signal.SIGINT
        return _failed(
            "interrupted" if number == signal.SIGINT else f"ended by {signal.Signals(number).name}", 128 + number
        )


def _failed(message: str, code: int) -> int:
    """Print why a command ends, and return its exit code."""
    print(f"chmarl-pb: {message}", file=sys.stderr)
    return code


@contextmanager
def _stopped_by_signals() -> Iterator[None]:
    """Let the signals that end a process unwind the block, so that what it began is put away."""
    if threading.current_thread() is not threading.main_thread():
        yield  # signals are the main thread's affair
        return
    numbers = [getattr(signal, name) for name in ("SIGTERM", "SIGHUP") if hasattr(signal, name)]
    before = {number: signal.getsignal(number) for number in numbers}
    for number in [number for number in numbers if before[number] is signal.SIG_DFL]:  # nohup ignores SIGHUP
        signal.signal(number, _stop)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def _stop(number: int, frame: FrameType | None) -> None:
    raise Stopped(number)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="chmarl-pb", description="Cooperative robots in homes, on PyBullet.")
    parser.add_argument("--version", action="version", version=__version__)
    parsers = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_demo(parsers)
    _add_homes(parsers)
    _add_tasks(parsers)
    _add_dataset(parsers)
    _add_evaluate(parsers)
    _add_baselines(parsers)
    _add_report(parsers)
    _add_episode(parsers)
    _add_bench(parsers)
    _add_cache(parsers)
    return parser


def _add(parsers: argparse._SubParsersAction, name: str, text: str, run: Command) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = parsers.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    parser.set_defaults(run=run)
    return parser


def _file(text: str) -> Path:
    """Return the path of a file to write, or say at once why nothing can be written there."""
    return _writable(Path(text), Path(text).is_dir(), "is a folder; name a file in it")


def _folder(text: str) -> Path:
    """Return the path of a folder to write to, or say at once why nothing can be written there."""
    return _writable(Path(text), Path(text).is_file(), "is a file; name a folder")


def _writable(path: Path, wrong: bool, words: str) -> Path:
    if wrong:
        raise argparse.ArgumentTypeError(f"{path} {words}")
    for parent in path.parents:
        if parent.is_file():
            raise argparse.ArgumentTypeError(f"{parent} is a file; name a folder")
    return path


def _add_demo(parsers: argparse._SubParsersAction) -> None:
    demo = _add(parsers, "demo", "let the planner solve a task, as a video and a page", commands.demo)
    demo.add_argument("--task", metavar="ID", help="task to play, e.g. test-unseen-007 (default: a good one)")
    demo.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    demo.add_argument(
        "--out", type=_folder, default=Path("out"), metavar="DIR", help="folder to write to (default: out)"
    )


def _add_homes(parsers: argparse._SubParsersAction) -> None:
    homes = parsers.add_parser("homes", help="list, check, draw and build homes")
    verbs = homes.add_subparsers(required=True, metavar="VERB")
    _add(verbs, "list", "list the homes that come with the package", commands.homes_list)
    check = _add(verbs, "check", "check that a home can be played", commands.homes_check)
    check.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    preview = _add(verbs, "preview", "draw a home from above", commands.homes_preview)
    preview.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    preview.add_argument("--out", type=_file, required=True, metavar="PNG", help="picture to write")
    build = _add(verbs, "build", "build a home's URDF from its layout", commands.homes_build)
    build.add_argument("layout", type=Path, metavar="TOML", help="layout file")
    build.add_argument("--out", type=_file, metavar="URDF", help="file to write (default: beside the layout)")


def _add_tasks(parsers: argparse._SubParsersAction) -> None:
    tasks = parsers.add_parser("tasks", help="make the benchmark's task files")
    verbs = tasks.add_subparsers(required=True, metavar="VERB")
    build = _add(verbs, "build", "draw and solve the tasks of all splits", commands.tasks_build)
    build.add_argument("--out", type=_folder, required=True, metavar="DIR", help="folder for the CSV files")
    build.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")


def _add_dataset(parsers: argparse._SubParsersAction) -> None:
    dataset = parsers.add_parser("dataset", help="make, verify and describe data sets of planner trajectories")
    verbs = dataset.add_subparsers(required=True, metavar="VERB")
    generate = _add(
        verbs, "generate", "let the planner play all tasks and store it as Minari data sets", commands.generate
    )
    generate.add_argument("--observation", choices=("scene_graph", "visual", "both"), default="scene_graph")
    generate.add_argument("--noise", type=float, default=0.0, metavar="EPS", help="share of random actions (default 0)")
    generate.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random actions (default: 0)")
    generate.add_argument("--limit", type=int, metavar="N", help="play only the first N tasks of each split")
    verify = _add(verbs, "verify", "check the files of data sets and replay their episodes", commands.verify)
    verify.add_argument("--share", type=float, default=1.0, metavar="F", help="share of episodes (default: 1)")
    for verb in (generate, verify):
        verb.add_argument("--split", action="append", metavar="S", help="only this split; may be repeated")
        verb.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    stats = _add(verbs, "stats", "print statistics of tasks, data sets and language", commands.dataset_stats)
    stats.add_argument("--json", type=_file, metavar="FILE", help="write them here as well")
    for verb in (generate, verify, stats):
        verb.add_argument("--out", type=_folder, metavar="DIR", help="folder of data sets (default: Minari's own)")


def _add_evaluate(parsers: argparse._SubParsersAction) -> None:
    evaluate = _add(
        parsers, "evaluate", "play all tasks of a split with a policy and print its metrics", commands.evaluate
    )
    evaluate.add_argument(
        "--policy", required=True, metavar="P",
        help="random, planner, search, search-silent, search-alone, module:callable, or a checkpoint's path",
    )  # fmt: skip
    evaluate.add_argument("--split", default="test-unseen", metavar="S", help="split (default: test-unseen)")
    evaluate.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    evaluate.add_argument("--seeds", type=int, default=3, metavar="K", help="seeds 0 to K - 1 (default: 3)")
    evaluate.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    evaluate.add_argument("--no-messages", dest="messages", action="store_false", help="messages read as zeros")
    evaluate.add_argument(
        "--feedback", choices=("paper", "planner"), default=True, help="style of the language feedback (default: paper)"
    )
    evaluate.add_argument("--no-feedback", dest="feedback", action="store_false", help="no language feedback")
    evaluate.add_argument("--goal", action="store_true", help=_GOAL)
    evaluate.add_argument("--max-steps", type=int, metavar="N", help="joint steps in an episode (default: 28)")
    evaluate.add_argument("--label", metavar="NAME", help="row of the report (default: the policy)")
    evaluate.add_argument("--task", action="append", metavar="ID", help="play this task only; may be repeated")
    evaluate.add_argument(
        "--out", type=_file, metavar="JSON", help="write the result here; the same command goes on when interrupted"
    )


def _add_baselines(parsers: argparse._SubParsersAction) -> None:
    text = "evaluate the built-in policies on all splits and print the tables"
    baselines = _add(parsers, "baselines", text, commands.baselines)
    baselines.add_argument("--split", action="append", metavar="S", help="only this split; may be repeated")
    baselines.add_argument("--seeds", type=int, default=3, metavar="K", help="seeds 0 to K - 1 (default: 3)")
    baselines.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    baselines.add_argument(
        "--out", type=_folder, default=Path("out/baselines"), metavar="DIR", help="folder for results"
    )
    baselines.add_argument(
        "--references", type=_folder, metavar="DIR", help="write the reference lengths of cooperation here"
    )


def _add_report(parsers: argparse._SubParsersAction) -> None:
    report = _add(parsers, "report", "gather results into one web page, beside the paper's", commands.report)
    report.add_argument(
        "results", type=Path, nargs="*", default=[Path("out/baselines")], metavar="RESULT.json",
        help="result files or folders of them (default: out/baselines)",
    )  # fmt: skip
    report.add_argument("--out", type=_file, default=Path("out/report.html"), metavar="HTML", help="page to write")


def _add_episode(parsers: argparse._SubParsersAction) -> None:
    episode = parsers.add_parser("episode", help="save, replay and show single episodes")
    verbs = episode.add_subparsers(required=True, metavar="VERB")
    save = _add(verbs, "save", "play a task with a policy and save the episode as a file", commands.episode_save)
    save.add_argument("--policy", default="planner", metavar="P", help="as for evaluate (default: planner)")
    save.add_argument("--task", required=True, metavar="ID", help="task to play, e.g. test-unseen-007")
    save.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    save.add_argument("--goal", action="store_true", help=_GOAL)
    save.add_argument("--seed", type=int, default=0, metavar="N", help="as in evaluate (default: 0)")
    save.add_argument("--out", type=_file, required=True, metavar="FILE", help="file to write")
    replay = _add(verbs, "replay", "play a file again and compare every state", commands.episode_replay)
    replay.add_argument("file", type=Path, metavar="FILE", help="episode file")
    show = _add(verbs, "show", "make the demo's video and page of an episode file", commands.episode_show)
    show.add_argument("file", type=Path, metavar="FILE", help="episode file")
    show.add_argument(
        "--out", type=_folder, default=Path("out"), metavar="DIR", help="folder to write to (default: out)"
    )


def _add_bench(parsers: argparse._SubParsersAction) -> None:
    bench = _add(parsers, "bench", "measure the speed on this machine", commands.bench)
    bench.add_argument("--json", type=_file, metavar="FILE", help="write the figures here as well")
    bench.add_argument(
        "--only", action="append", metavar="NAME", help="only figures whose name contains this; may be repeated"
    )
    bench.add_argument("--runs", type=int, default=5, metavar="N", help="runs of each figure (default: 5)")
    bench.add_argument(
        "--warm-up", type=int, default=100_000, metavar="N",
        help="joint steps whose views are drawn before what is measured warm (default: 100000)",
    )  # fmt: skip


def _add_cache(parsers: argparse._SubParsersAction) -> None:
    cache = _add(parsers, "cache", "show, clear or fill the pictures of homes that are kept on disk", commands.cache)
    what = cache.add_mutually_exclusive_group()
    what.add_argument("--clear", action="store_true", help="remove them")
    what.add_argument("--fill", nargs="+", metavar="HOME", help="draw all views of these homes, e.g. before a training")
    cache.add_argument("--size", type=int, default=128, metavar="N", help="pixels of the views to draw (default: 128)")
    cache.add_argument("--workers", type=int, default=2, metavar="N", help="processes that draw (default: 2)")


if __name__ == "__main__":
    sys.exit(main())
