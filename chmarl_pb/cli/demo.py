"""The command ``chmarl-pb demo``: play one task, print it, and write its video and its page."""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeElapsedColumn

from chmarl_pb.cli.arguments import (
    add_catalog,
    add_home,
    add_lookalikes,
    add_robots,
    add_track,
    check_home,
    output_folder,
)
from chmarl_pb.cli.output import Screen
from chmarl_pb.envs.options import OBSERVATIONS
from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.evaluation.drawn import draw_tasks
from chmarl_pb.evaluation.episode_file import EpisodeFile
from chmarl_pb.files import open_folder
from chmarl_pb.frames.frame import Image
from chmarl_pb.frames.panel import HEIGHT, WIDTH
from chmarl_pb.frames.recording import Recording
from chmarl_pb.progress import LateProgress, is_silent
from chmarl_pb.tasks.splits import find_task
from chmarl_pb.tasks.task import Task
from chmarl_pb.viewer.film import Shot, storyboard
from chmarl_pb.viewer.frame import compose
from chmarl_pb.viewer.page import write_page
from chmarl_pb.viewer.record import choose_task, record, record_file
from chmarl_pb.viewer.studio import compiling, draw_views
from chmarl_pb.viewer.table import print_table
from chmarl_pb.viewer.video import write_video


def add(parser: argparse.ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.set_defaults(run=_run)
    parser.add_argument("--task", metavar="ID", help="task to play, e.g. test-unseen-007 (default: a good one)")
    add_robots(parser)
    add_home(parser, "a task is drawn for it")
    add_catalog(parser)
    add_track(parser)
    parser.add_argument(
        "--observation",
        choices=OBSERVATIONS,
        default="scene_graph",
        help="what the policy observes (default: %(default)s)",
    )
    add_lookalikes(parser)
    parser.add_argument(
        "--out", type=output_folder, default=Path("out"), metavar="DIR", help="folder to write to (default: out)"
    )


def _run(options: argparse.Namespace) -> int:
    """Play the task that is named, or one that is drawn for the home that is named."""
    check_home(options)
    task: str | Task | None = options.task
    names = ("robots", "catalog", "lookalikes", "track")
    given = {name: getattr(options, name) for name in names}
    if options.home is not None:
        (task,) = draw_tasks(options.home, 1, **given)
    return demo(task, options.observation, options.out, **given)


def demo(task: str | Task | None, observation: str, out: Path, policy: str = "planner", **options: Any) -> int:
    """Play one task and show it; return the exit code.

    Args:
        task: the task, or its id; a task of test-unseen that leads through two rooms if None.
        observation: what the policy observes, "visual" or "scene_graph".
        out: folder for ``demo.mp4`` and ``demo.html``.
        policy: "planner", "search" or "random".
        **options: of the environment, as ``robots``.

    Raises:
        TaskError: the task is unknown, or the planner cannot solve it with these robots.
        AssetError: there is no such robot.
        OptionError: an option is unknown, or the folder cannot be written to.
    """
    chosen = choose_task() if task is None else find_task(task) if isinstance(task, str) else task
    folder, console = open_folder(out), Screen()
    with _progress(console) as progress, compiling():
        bar = progress.add_task("Playing", total=chosen.optimal_steps if policy == "planner" else MAX_STEPS)
        recording = record(chosen, observation, policy, lambda: progress.advance(bar), **options)
    _show(recording, folder, console)
    return 0


def show_episode(file: EpisodeFile, out: Path, film: bool = True, name: str = "demo") -> int:
    """Show an episode file as the demo shows its episode; return the exit code.

    Args:
        file: the episode.
        out: folder for the video and the page.
        film: whether there is a video; the page alone takes less than half the time.
        name: of the files, ``demo.mp4`` and ``demo.html``.

    Raises:
        OptionError: the folder cannot be written to.
    """
    folder, console = open_folder(out), Screen()
    with _progress(console) as progress:
        bar = progress.add_task("Playing", total=len(file.actions))
        recording = record_file(file, lambda: progress.advance(bar))
    _show(recording, folder, console, film, name)
    return 0


def _show(recording: Recording, folder: Path, console: Console, film: bool = True, name: str = "demo") -> None:
    """Print a recording, and write its video and its page."""
    if not is_silent():
        print_table(recording, console)
    with _progress(console) as progress:
        if film:
            write_files(recording, storyboard(recording), folder, progress, name)
        else:
            write_step_page(recording, folder / f"{name}.html", progress)
    for ending, sentence in (("mp4", "the video"),) * film + (("html", "step by step"),):
        console.print(f"{folder / name}.{ending}  [dim]{sentence}[/dim]", soft_wrap=True)


def write_step_page(recording: Recording, path: Path, progress: LateProgress) -> None:
    """Draw what the robots see after each step, and write the page."""
    shots = [shot for shot in storyboard(recording) if shot.done]
    views = draw_views(recording.home, recording.team, shots)
    write_page(path, recording, list(progress.count(views, len(shots), "Drawing")))


def write_files(
    recording: Recording, shots: list[Shot], folder: Path, progress: LateProgress, name: str = "demo"
) -> None:
    """Draw all shots; write the video and the page.

    Args:
        recording: the episode.
        shots: of the video, with one at rest for each moment.
        folder: for ``demo.mp4`` and ``demo.html``.
        progress: gets a bar.
        name: of the files.
    """
    rests: list[dict[str, Image]] = []
    views = _keep_rests(shots, draw_views(recording.home, recording.team, shots), rests)
    frames = progress.count(compose(recording, shots, views), len(shots), "Drawing")
    counted = ((frame, shot.frames) for frame, shot in zip(frames, shots, strict=True))
    write_video(folder / f"{name}.mp4", counted, (WIDTH, HEIGHT))
    write_page(folder / f"{name}.html", recording, rests)


def _keep_rests(
    shots: list[Shot], views: Iterator[dict[str, Image]], rests: list[dict[str, Image]]
) -> Iterator[dict[str, Image]]:
    """Pass views on, and keep those of steps that are over."""
    for shot, pictures in zip(shots, views, strict=True):
        if shot.done:
            rests.append(pictures)
        yield pictures


def _progress(console: Console) -> LateProgress:
    columns: tuple[Any, ...] = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn())
    return LateProgress(*columns, TimeElapsedColumn(), console=console)
