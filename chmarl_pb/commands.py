"""What each command of ``chmarl-pb`` calls, with its options.

Each imports what it needs, so that --help and --version answer at once.
"""

import argparse
import sys


def demo(options: argparse.Namespace) -> int:
    """Play one task and show it."""
    from chmarl_pb.demo.command import demo

    return demo(options.task, options.observation, options.out)


def homes_list(options: argparse.Namespace) -> int:
    """Print the packaged homes."""
    from chmarl_pb.homes.home import home_names, load_home

    for name in home_names():
        home = load_home(name)
        area = sum(room.area for room in home.rooms.values())
        classes = {thing.class_name for thing in home.receptacles.values()}
        print(f"{name}  {area:5.1f} m2  {len(home.things)} things, {len(classes)} receptacle classes  {home.path}")
    return 0


def homes_check(options: argparse.Namespace) -> int:
    """Print what keeps a home from being played; return 1 if anything does."""
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


def homes_preview(options: argparse.Namespace) -> int:
    """Draw a home from above."""
    from chmarl_pb.homes.home import home_path
    from chmarl_pb.sensing.preview import preview

    preview(home_path(options.file), options.out)
    print(options.out)
    return 0


def homes_build(options: argparse.Namespace) -> int:
    """Build a home's URDF from its layout."""
    from chmarl_pb.homes.assemble import build_home

    print(build_home(options.layout, options.out))
    return 0


def tasks_build(options: argparse.Namespace) -> int:
    """Make the task files."""
    from chmarl_pb.data.build_tasks import build_all

    return build_all(options.out, options.workers)


def generate(options: argparse.Namespace) -> int:
    """Make data sets."""
    from chmarl_pb.data.command import run_generate

    return run_generate(
        options.split or (), options.observation, options.workers, options.noise, options.seed, options.limit,
        options.out,
    )  # fmt: skip


def verify(options: argparse.Namespace) -> int:
    """Verify data sets."""
    from chmarl_pb.data.command import run_verify

    return run_verify(options.split or (), options.share, options.workers, options.out)


def dataset_stats(options: argparse.Namespace) -> int:
    """Print statistics of data sets."""
    from chmarl_pb.data.command import run_stats

    return run_stats(options.out, options.json)


def evaluate(options: argparse.Namespace) -> int:
    """Evaluate a policy."""
    from chmarl_pb.envs.options import MAX_STEPS
    from chmarl_pb.evaluation.command import run_evaluation

    return run_evaluation(
        options.policy, options.split, options.observation, options.seeds, options.workers, options.messages,
        options.feedback, MAX_STEPS if options.max_steps is None else options.max_steps, options.task, options.out,
        options.label, options.goal,
    )  # fmt: skip


def baselines(options: argparse.Namespace) -> int:
    """Evaluate the built-in policies."""
    from chmarl_pb.evaluation.baselines import run_baselines
    from chmarl_pb.tasks.splits import SPLITS

    return run_baselines(options.split or SPLITS, options.seeds, options.workers, options.out, options.references)


def report(options: argparse.Namespace) -> int:
    """Gather results into a page."""
    from chmarl_pb.evaluation.report import write_report

    return write_report(options.results, options.out)


def episode_save(options: argparse.Namespace) -> int:
    """Play a task and save the episode."""
    from chmarl_pb.evaluation.episodes import save

    return save(options.policy, options.task, options.observation, options.seed, options.out, options.goal)


def episode_replay(options: argparse.Namespace) -> int:
    """Replay an episode file; return 1 if it goes another way."""
    from chmarl_pb.evaluation.episodes import replay

    return replay(options.file)


def episode_show(options: argparse.Namespace) -> int:
    """Show an episode file."""
    from chmarl_pb.demo.command import show_episode
    from chmarl_pb.envs.episode_file import load_episode

    return show_episode(load_episode(options.file), options.out)


def bench(options: argparse.Namespace) -> int:
    """Measure the speed."""
    from chmarl_pb.bench.command import run

    return run(options.json, options.only or (), options.runs, options.warm_up)


def cache(options: argparse.Namespace) -> int:
    """Show, clear or fill the kept views."""
    from chmarl_pb.sensing.command import run_cache, run_fill

    if options.fill:
        return run_fill(options.fill, options.size, options.workers)
    return run_cache(options.clear)
