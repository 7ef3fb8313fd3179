"""How speed depends on objects, home size, environments and picture size: ``python -m benchmarks.scaling``.

Each point is measured in a process of its own. A run plays the same episodes as the warm-up did, so that every view of
the empty home is kept, however large the home; only joint steps are timed, resets are reported apart.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any

from rich.progress import Progress

from chmarl_pb.extras import needs
from chmarl_pb.files import write_atomically

Point = dict[str, Any]
Measure = Callable[[int, str, argparse.Namespace], Point]
OBSERVATIONS = {"scene_graph": "scene graph", "visual": "two 128 px views"}
_TASKS = 20  # that a random policy plays in turn


def with_objects(count: int, observation: str, options: argparse.Namespace) -> Point:
    """Home 7 with a number of objects; the catalogue has 100 classes whatever their number."""
    from benchmarks.variants import dress_homes

    dress_homes(count)
    return _timed("home_7", observation, 128, options)


def with_rooms(copies: int, observation: str, options: argparse.Namespace) -> Point:
    """Home 7 several times in a row, joined by doors, with 19 objects in each; the catalogue has 152 classes."""
    from benchmarks.variants import dress_homes, row_of_homes

    dress_homes(19 * copies, known=152)
    with tempfile.TemporaryDirectory() as folder:
        return _timed(str(row_of_homes(copies, Path(folder))), observation, 128, options)


def with_pixels(size: int, observation: str, options: argparse.Namespace) -> Point:
    """Home 7 with pictures of a size."""
    return _timed("home_7", observation, size, options)


def with_environments(count: int, observation: str, options: argparse.Namespace) -> Point:
    """A vector environment of home 7, on as many processes as there are cores; resets are in its steps."""
    from chmarl_pb.bench.playing import per_second
    from chmarl_pb.bench.vectors import our_vector

    envs = our_vector(count, min(count, os.cpu_count() or 1), observation)
    for _ in range(options.steps):
        envs.step()
    rates = [per_second(envs.step, options.steps / 5000, count) for _ in range(options.runs)]
    envs.close()
    return {"steps/s": rates}


#: Panel -> what its axis shows, its points, what it is measured with, and how.
PANELS: dict[str, tuple[str, tuple[int, ...], tuple[str, ...], Measure]] = {
    "objects": ("movable objects in the home", (5, 10, 20, 40, 60, 80, 100), tuple(OBSERVATIONS), with_objects),
    "rooms": ("size of the home (times home 7: 5 rooms)", (1, 2, 4, 8), tuple(OBSERVATIONS), with_rooms),
    "environments": ("environments", (1, 2, 3, 4, 6, 8), tuple(OBSERVATIONS), with_environments),
    "pixels": ("width of both pictures (px)", (32, 64, 96, 128, 160, 192, 224, 256), ("visual",), with_pixels),
}


def _timed(home: str, observation: str, size: int, options: argparse.Namespace) -> Point:
    """Return joint steps a second without resets, resets a second, and the mean number of movable things in a view."""
    import numpy as np

    from chmarl_pb.envs.parallel import HouseholdEnv

    env = HouseholdEnv(observation, home=home, image_size=size)
    tasks = _tasks(env)
    choices = [len(names) for names in env.action_names.values()]

    def play(seen: list[int] | None = None) -> tuple[float, float]:
        """Play the episodes; return the seconds a step and a reset, and append how much movable each view shows."""
        queue, resets, in_resets, start = cycle(tasks), 0, 0.0, time.perf_counter()
        for actions in np.random.default_rng(1).integers(choices, size=(options.steps, len(choices))).tolist():
            if not env.agents:
                before = time.perf_counter()
                env.reset(options={"task": next(queue)})
                in_resets, resets = in_resets + time.perf_counter() - before, resets + 1
            _, _, _, _, infos = env.step(dict(zip(env.possible_agents, actions, strict=True)))
            if seen is not None:
                seen += [sum(name in env.world.bodies for name in info["visible"]) for info in infos.values()]
        return (time.perf_counter() - start - in_resets) / options.steps, in_resets / resets

    seen: list[int] = []
    play(seen)
    runs = []
    for _ in range(options.runs):
        env.agents = []  # every run begins with a reset
        runs.append(play())
    env.close()
    return {
        "steps/s": [1 / step for step, _ in runs],
        "resets/s": [1 / reset for _, reset in runs],
        "movable things in a view": statistics.mean(seen),
    }


def _tasks(env: Any) -> list[Any]:
    """Return tasks that fit in the home of an environment; whether they can be solved does not matter here."""
    import numpy as np

    from chmarl_pb.errors import TaskError
    from chmarl_pb.tasks.sampling import sample_task

    def fitting() -> Iterator[Any]:
        rng, failed = np.random.default_rng(0), 0
        while True:
            task = sample_task(env.simulation.space, str(env.simulation.home.path), rng)
            try:
                env.reset(options={"task": task})
            except TaskError:
                failed += 1
                if failed == 10 * _TASKS:
                    raise
                continue
            yield task

    return [task for task, _ in zip(fitting(), range(_TASKS), strict=False)]


def point_of(panel: str, value: int, observation: str, options: argparse.Namespace) -> Point:
    """Measure a point in a process of its own."""
    command = [sys.executable, "-m", "benchmarks.scaling", "--runs", str(options.runs), "--steps", str(options.steps)]
    done = subprocess.run([*command, "--point", panel, str(value), observation], stdout=subprocess.PIPE, text=True)
    if done.returncode:
        raise RuntimeError(f"measuring {panel} {value} failed, see above")
    return {"panel": panel, "value": value, "observation": observation, **json.loads(done.stdout.splitlines()[-1])}


def plot(points: Sequence[Point], path: Path) -> None:
    """Draw the four panels: medians as lines, least to greatest as bands."""
    with needs("benchmarks.scaling", "report", script=True):
        import matplotlib

        matplotlib.use("Agg")
        from matplotlib import pyplot
        from matplotlib.layout_engine import ConstrainedLayoutEngine

    figure, axes = pyplot.subplots(2, 2, figsize=(9, 6.5), layout=ConstrainedLayoutEngine(w_pad=0.15, h_pad=0.15))
    for axis, (panel, (label, values, observations, _)) in zip(axes.flat, PANELS.items(), strict=True):
        for observation, colour in zip(OBSERVATIONS, ("#1b6ca8", "#d1603d"), strict=True):
            chosen = [point for point in points if (point["panel"], point["observation"]) == (panel, observation)]
            if not chosen or observation not in observations:
                continue
            x, rates = [point["value"] for point in chosen], [point["steps/s"] for point in chosen]
            name = "two views of that size" if panel == "pixels" else OBSERVATIONS[observation]
            axis.plot(x, [statistics.median(rate) for rate in rates], "o-", color=colour, label=name, markersize=4)
            axis.fill_between(x, list(map(min, rates)), list(map(max, rates)), color=colour, alpha=0.2, linewidth=0)
        axis.set(xlabel=label, xticks=values, ylim=(0, None), xlim=(0, None))
        axis.set_ylabel("joint steps/s, all together" if panel == "environments" else "joint steps/s")
        axis.grid(alpha=0.3)
        axis.spines[["top", "right"]].set_visible(False)
        axis.yaxis.set_major_formatter("{x:,.0f}")
        # Above the panel: within it no corner is free at every measurement.
        axis.legend(frameon=False, loc="lower right", bbox_to_anchor=(1, 1), ncols=2, borderaxespad=0.1)
    figure.savefig(path, dpi=130)
    pyplot.close(figure)


def main(arguments: Sequence[str] | None = None) -> int:
    """Measure all points, write them as JSON and draw them."""
    options = _options(arguments)
    if options.point:
        panel, value, observation = options.point
        print(json.dumps(PANELS[panel][3](int(value), observation, options)))
        return 0
    data = options.out.with_suffix(".json")
    if options.redraw:
        plot(json.loads(data.read_text(encoding="utf-8")), options.out)
        return 0
    wanted = [
        (panel, value, observation)
        for panel in options.panel or PANELS
        for value in PANELS[panel][1]
        for observation in PANELS[panel][2]
    ]
    points = json.loads(data.read_text(encoding="utf-8")) if options.panel and data.is_file() else []
    points = [point for point in points if point["panel"] not in (options.panel or PANELS)]
    with Progress(transient=True) as progress:
        for panel, value, observation in progress.track(wanted):
            points.append(point_of(panel, value, observation, options))
            rate = statistics.median(points[-1]["steps/s"])
            progress.console.print(f"{panel} {value}, {observation}: {rate:,.0f} joint steps/s")
    write_atomically(data, json.dumps(points, indent=1) + "\n")
    plot(points, options.out)
    return 0


def _options(arguments: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--panel", action="append", choices=tuple(PANELS), help="measure only this panel anew")
    parser.add_argument("--steps", type=int, default=3000, metavar="N", help="joint steps of a run (default: 3000)")
    parser.add_argument("--runs", type=int, default=5, metavar="N", help="runs of each point (default: 5)")
    parser.add_argument("--out", type=Path, default=Path("docs/scaling.png"), metavar="PNG", help="plot to write")
    parser.add_argument("--redraw", action="store_true", help="only draw the plot from its JSON again")
    parser.add_argument("--point", nargs=3, metavar=("PANEL", "VALUE", "OBSERVATION"), help=argparse.SUPPRESS)
    options = parser.parse_args(arguments)
    if options.steps < 1 or options.runs < 1:
        parser.error("--steps and --runs: use at least 1")
    return options


if __name__ == "__main__":
    sys.exit(main())
