"""``chmarl-pb``: a thin face over the package."""

import argparse
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

from chmarl_pb import __version__
from chmarl_pb.errors import ChmarlError

Command = Callable[[argparse.Namespace], int]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; 0 on success, 1 if a check failed, 2 on bad input, 130 when interrupted."""
    options = _parser().parse_args(arguments)
    try:
        return int(options.run(options))
    except ChmarlError as error:
        print(f"chmarl-pb: {error}", file=sys.stderr)
        return 2
    except OSError as error:
        print(f"chmarl-pb: {error.filename or ''}: {error.strerror}; choose another file or folder", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("chmarl-pb: interrupted", file=sys.stderr)
        return 130


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="chmarl-pb", description="Cooperative robots in homes, on PyBullet.")
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_demo(commands)
    _add_homes(commands)
    _add_tasks(commands)
    _add_dataset(commands)
    _add_evaluate(commands)
    _add_baselines(commands)
    _add_report(commands)
    _add_episode(commands)
    _add_bench(commands)
    _add_cache(commands)
    return parser


def _add(commands: argparse._SubParsersAction, name: str, text: str, run: Command) -> argparse.ArgumentParser:
    parser: argparse.ArgumentParser = commands.add_parser(name, help=text, description=text[0].upper() + text[1:] + ".")
    parser.set_defaults(run=run)
    return parser


def _add_demo(commands: argparse._SubParsersAction) -> None:
    demo = _add(commands, "demo", "let the planner solve a task, as a video and a page", _demo)
    demo.add_argument("--task", metavar="ID", help="task to play, e.g. test-unseen-007 (default: a good one)")
    demo.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    demo.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="folder to write to (default: out)")


def _add_homes(commands: argparse._SubParsersAction) -> None:
    homes = commands.add_parser("homes", help="list, check, draw and build homes")
    verbs = homes.add_subparsers(required=True, metavar="VERB")
    _add(verbs, "list", "list the homes that come with the package", _homes_list)
    check = _add(verbs, "check", "check that a home can be played", _homes_check)
    check.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    preview = _add(verbs, "preview", "draw a home from above", _homes_preview)
    preview.add_argument("file", metavar="FILE", help="a home's URDF, or the name of a packaged home")
    preview.add_argument("--out", type=Path, required=True, metavar="PNG", help="picture to write")
    build = _add(verbs, "build", "build a home's URDF from its layout", _homes_build)
    build.add_argument("layout", type=Path, metavar="TOML", help="layout file")
    build.add_argument("--out", type=Path, metavar="URDF", help="file to write (default: beside the layout)")


def _add_tasks(commands: argparse._SubParsersAction) -> None:
    tasks = commands.add_parser("tasks", help="make the benchmark's task files")
    verbs = tasks.add_subparsers(required=True, metavar="VERB")
    build = _add(verbs, "build", "draw and solve the tasks of all splits", _tasks_build)
    build.add_argument("--out", type=Path, required=True, metavar="DIR", help="folder for the CSV files")
    build.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")


def _add_dataset(commands: argparse._SubParsersAction) -> None:
    dataset = commands.add_parser("dataset", help="make, verify and describe data sets of planner trajectories")
    verbs = dataset.add_subparsers(required=True, metavar="VERB")
    generate = _add(verbs, "generate", "let the planner play all tasks and store it as Minari data sets", _generate)
    generate.add_argument("--observation", choices=("scene_graph", "visual", "both"), default="scene_graph")
    generate.add_argument("--noise", type=float, default=0.0, metavar="EPS", help="share of random actions (default 0)")
    generate.add_argument("--seed", type=int, default=0, metavar="N", help="seed of the random actions (default: 0)")
    generate.add_argument("--limit", type=int, metavar="N", help="play only the first N tasks of each split")
    verify = _add(verbs, "verify", "check the files of data sets and replay their episodes", _verify)
    verify.add_argument("--share", type=float, default=1.0, metavar="F", help="share of episodes (default: 1)")
    for verb in (generate, verify):
        verb.add_argument("--split", action="append", metavar="S", help="only this split; may be repeated")
        verb.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    stats = _add(verbs, "stats", "print statistics of tasks, data sets and language", _dataset_stats)
    stats.add_argument("--json", type=Path, metavar="FILE", help="write them here as well")
    for verb in (generate, verify, stats):
        verb.add_argument("--out", type=Path, metavar="DIR", help="folder of data sets (default: Minari's own)")


def _add_evaluate(commands: argparse._SubParsersAction) -> None:
    evaluate = _add(commands, "evaluate", "play all tasks of a split with a policy and print its metrics", _evaluate)
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
    evaluate.add_argument("--max-steps", type=int, metavar="N", help="joint steps in an episode (default: 28)")
    evaluate.add_argument("--label", metavar="NAME", help="row of the report (default: the policy)")
    evaluate.add_argument("--task", action="append", metavar="ID", help="play this task only; may be repeated")
    evaluate.add_argument(
        "--out", type=Path, metavar="JSON", help="write the result here; the same command goes on after an interruption"
    )


def _add_baselines(commands: argparse._SubParsersAction) -> None:
    text = "evaluate the built-in policies on all splits and print the tables"
    baselines = _add(commands, "baselines", text, _baselines)
    baselines.add_argument("--split", action="append", metavar="S", help="only this split; may be repeated")
    baselines.add_argument("--seeds", type=int, default=3, metavar="K", help="seeds 0 to K - 1 (default: 3)")
    baselines.add_argument("--workers", type=int, default=2, metavar="N", help="processes (default: 2)")
    baselines.add_argument("--out", type=Path, default=Path("out/baselines"), metavar="DIR", help="folder for results")
    baselines.add_argument(
        "--references", type=Path, metavar="DIR", help="write the reference lengths of cooperation here"
    )


def _add_report(commands: argparse._SubParsersAction) -> None:
    report = _add(commands, "report", "gather results into one web page, beside the paper's", _report)
    report.add_argument(
        "results", type=Path, nargs="*", default=[Path("out/baselines")], metavar="RESULT.json",
        help="result files or folders of them (default: out/baselines)",
    )  # fmt: skip
    report.add_argument("--out", type=Path, default=Path("out/report.html"), metavar="HTML", help="page to write")


def _add_episode(commands: argparse._SubParsersAction) -> None:
    episode = commands.add_parser("episode", help="save, replay and show single episodes")
    verbs = episode.add_subparsers(required=True, metavar="VERB")
    save = _add(verbs, "save", "play a task with a policy and save the episode as a file", _episode_save)
    save.add_argument("--policy", default="planner", metavar="P", help="as for evaluate (default: planner)")
    save.add_argument("--task", required=True, metavar="ID", help="task to play, e.g. test-unseen-007")
    save.add_argument("--observation", choices=("scene_graph", "visual"), default="scene_graph")
    save.add_argument("--seed", type=int, default=0, metavar="N", help="as in evaluate (default: 0)")
    save.add_argument("--out", type=Path, required=True, metavar="FILE", help="file to write")
    replay = _add(verbs, "replay", "play a file again and compare every state", _episode_replay)
    replay.add_argument("file", type=Path, metavar="FILE", help="episode file")
    show = _add(verbs, "show", "make the demo's video and page of an episode file", _episode_show)
    show.add_argument("file", type=Path, metavar="FILE", help="episode file")
    show.add_argument("--out", type=Path, default=Path("out"), metavar="DIR", help="folder to write to (default: out)")


def _add_bench(commands: argparse._SubParsersAction) -> None:
    bench = _add(commands, "bench", "measure the speed on this machine", _bench)
    bench.add_argument("--json", type=Path, metavar="FILE", help="write the figures here as well")
    bench.add_argument(
        "--only", action="append", metavar="NAME", help="only figures whose name contains this; may be repeated"
    )
    bench.add_argument("--runs", type=int, default=5, metavar="N", help="runs of each figure (default: 5)")
    bench.add_argument(
        "--warm-up", type=int, default=100_000, metavar="N",
        help="joint steps whose views are drawn before what is measured warm (default: 100000)",
    )  # fmt: skip


def _add_cache(commands: argparse._SubParsersAction) -> None:
    cache = _add(commands, "cache", "show, clear or fill the pictures of homes that are kept on disk", _cache)
    what = cache.add_mutually_exclusive_group()
    what.add_argument("--clear", action="store_true", help="remove them")
    what.add_argument("--fill", nargs="+", metavar="HOME", help="draw all views of these homes, e.g. before a training")
    cache.add_argument("--size", type=int, default=128, metavar="N", help="pixels of the views to draw (default: 128)")
    cache.add_argument("--workers", type=int, default=2, metavar="N", help="processes that draw (default: 2)")


# Each command imports what it needs, so that --help and --version answer at once.


def _demo(options: argparse.Namespace) -> int:
    from chmarl_pb.demo.command import demo

    return demo(options.task, options.observation, options.out)


def _homes_list(options: argparse.Namespace) -> int:
    from chmarl_pb.homes.home import home_names, load_home

    for name in home_names():
        home = load_home(name)
        area = sum(room.area for room in home.rooms.values())
        classes = {thing.class_name for thing in home.receptacles.values()}
        print(f"{name}  {area:5.1f} m2  {len(home.things)} things, {len(classes)} receptacle classes  {home.path}")
    return 0


def _homes_check(options: argparse.Namespace) -> int:
    from chmarl_pb.homes.check import check_home
    from chmarl_pb.world import World

    report = check_home(options.file)
    World(report.home).close()  # says so if PyBullet cannot load it
    for problem in report.problems:
        print(f"{report.home.path}: {problem}", file=sys.stderr)
    if report.problems:
        return 1
    print(f"{report.home.path}: good: {', '.join(report.home.rooms)}; {len(report.places)} receptacles within reach")
    return 0


def _homes_preview(options: argparse.Namespace) -> int:
    from chmarl_pb.homes.home import home_path
    from chmarl_pb.sensing.preview import preview

    preview(home_path(options.file), options.out)
    print(options.out)
    return 0


def _homes_build(options: argparse.Namespace) -> int:
    from chmarl_pb.homes.assemble import build_home

    print(build_home(options.layout, options.out))
    return 0


def _tasks_build(options: argparse.Namespace) -> int:
    from chmarl_pb.data.build_tasks import build_all

    return build_all(options.out, options.workers)


def _generate(options: argparse.Namespace) -> int:
    from chmarl_pb.data.command import run_generate

    return run_generate(
        options.split or (), options.observation, options.workers, options.noise, options.seed, options.limit,
        options.out,
    )  # fmt: skip


def _verify(options: argparse.Namespace) -> int:
    from chmarl_pb.data.command import run_verify

    return run_verify(options.split or (), options.share, options.workers, options.out)


def _dataset_stats(options: argparse.Namespace) -> int:
    from chmarl_pb.data.command import run_stats

    return run_stats(options.out, options.json)


def _evaluate(options: argparse.Namespace) -> int:
    from chmarl_pb.envs.options import MAX_STEPS
    from chmarl_pb.evaluation.command import run_evaluation

    return run_evaluation(
        options.policy, options.split, options.observation, options.seeds, options.workers, options.messages,
        options.feedback, MAX_STEPS if options.max_steps is None else options.max_steps, options.task, options.out,
        options.label,
    )  # fmt: skip


def _baselines(options: argparse.Namespace) -> int:
    from chmarl_pb.evaluation.baselines import run_baselines
    from chmarl_pb.tasks.splits import SPLITS

    return run_baselines(options.split or SPLITS, options.seeds, options.workers, options.out, options.references)


def _report(options: argparse.Namespace) -> int:
    from chmarl_pb.evaluation.report import write_report

    return write_report(options.results, options.out)


def _episode_save(options: argparse.Namespace) -> int:
    from chmarl_pb.evaluation.episodes import save

    return save(options.policy, options.task, options.observation, options.seed, options.out)


def _episode_replay(options: argparse.Namespace) -> int:
    from chmarl_pb.evaluation.episodes import replay

    return replay(options.file)


def _episode_show(options: argparse.Namespace) -> int:
    from chmarl_pb.demo.command import show_episode
    from chmarl_pb.envs.episode_file import load_episode

    return show_episode(load_episode(options.file), options.out)


def _bench(options: argparse.Namespace) -> int:
    from chmarl_pb.bench.command import run

    return run(options.json, options.only or (), options.runs, options.warm_up)


def _cache(options: argparse.Namespace) -> int:
    from chmarl_pb.sensing.command import run_cache, run_fill

    if options.fill:
        return run_fill(options.fill, options.size, options.workers)
    return run_cache(options.clear)


if __name__ == "__main__":
    sys.exit(main())
