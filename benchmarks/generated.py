"""Check generated homes and tell what they are like, beside the benchmark's: ``python -m benchmarks.generated``.

Each home is made from its seed, checked, and tasks drawn for it are solved by the planner. Results are kept, one line a
home, so that a run that was stopped goes on where it was.
"""

import argparse
import json
import os
import tempfile
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.catalog import BENCHMARK, room_kind
from chmarl_pb.errors import TaskError
from chmarl_pb.files import append_line
from chmarl_pb.homes.furniture import load_model
from chmarl_pb.homes.generate.store import generate_home
from chmarl_pb.homes.layout import Layout, load_layout
from chmarl_pb.navigation.check import check_home
from chmarl_pb.tasks.sampling import sample_task
from chmarl_pb.tasks.simulation import Simulation

RESULTS = Path(__file__).parents[1] / "out" / "generated.jsonl"
Likeness = dict[str, Any]  # numbers, the text of the graph of rooms, and how many of each class


@dataclass(frozen=True)
class Result:
    """What was found about the home of a seed.

    Attributes:
        seed: of the home.
        seconds: processor time that making it took, URDF included.
        problems: why it cannot be played; empty if it can.
        tasks: how many were drawn.
        solved: how many of them the planner solved.
        unsolved: why it did not solve the others.
        likeness: what the home is like.
    """

    seed: int
    seconds: float
    problems: tuple[str, ...]
    tasks: int
    solved: int
    unsolved: tuple[str, ...]
    likeness: Likeness


def examine(seed: int, tasks: int, folder: Path) -> Result:
    """Make a home, check it, draw tasks and solve them.

    Args:
        seed: of the home.
        tasks: how many are drawn.
        folder: where the home is written.
    """
    start = time.process_time()
    path = generate_home(seed, folder)
    seconds = time.process_time() - start
    problems = tuple(map(str, check_home(path).problems))
    unsolved = () if problems or not tasks else tuple(_unsolved(path, seed, tasks))
    path.unlink()
    return Result(
        seed, seconds, problems, tasks, tasks - len(unsolved), unsolved, like(load_layout(path.with_suffix(".toml")))
    )


def _unsolved(path: Path, seed: int, tasks: int) -> Iterator[str]:
    """Yield for each of some drawn tasks that the planner cannot solve why it cannot."""
    simulation, rng = Simulation(str(path)), np.random.default_rng(seed)
    try:
        for _ in range(tasks):
            task = sample_task(simulation.space, str(path), rng)
            try:
                simulation.solve(task)
            except TaskError as error:
                yield f"{task.graspable}, {task.source} to {task.target}: {error}"
    finally:
        simulation.close()


def like(layout: Layout) -> Likeness:
    """Return what a home is like: its area, rooms, doors, furniture and the graph of its rooms."""
    classes = [load_model(piece.model).thing_class for piece in layout.furniture]
    areas = {room.name: sum((x1 - x0) * (y1 - y0) for x0, y0, x1, y1 in room.rects) for room in layout.rooms}
    return {
        "area": sum(areas.values()),
        "rooms": len(layout.rooms),
        "doors": len(layout.doors),
        "furniture": len(classes),
        "receptacles": sum(name in BENCHMARK.receptacles for name in classes),
        "receptacle classes": len({name for name in classes if name in BENCHMARK.receptacles}),
        "graph": graph_of(layout),
        "classes": dict(Counter(classes)),
        **{f"area of a {kind}": value for kind, value in _by_kind(areas).items()},
    }


def _by_kind(areas: dict[str, float]) -> dict[str, float]:
    kinds = sorted({room_kind(room) for room in areas})
    return {kind: float(np.mean([area for room, area in areas.items() if room_kind(room) == kind])) for kind in kinds}


def graph_of(layout: Layout) -> str:
    """Return which kinds of rooms a home has and which doors join them, the same text for the same graph."""
    rooms = {kind: [room.name for room in layout.rooms if room_kind(room.name) == kind] for kind in _kinds(layout)}
    doors = [door.between for door in layout.doors]
    texts = []
    for orders in product(*(permutations(names) for names in rooms.values())):
        names = {room: f"{kind}{n}" for kind, order in zip(rooms, orders, strict=True) for n, room in enumerate(order)}
        texts.append(" ".join(sorted("-".join(sorted((names[one], names[other]))) for one, other in doors)))
    return min(texts)


def _kinds(layout: Layout) -> list[str]:
    return sorted({room_kind(room.name) for room in layout.rooms})


def report(results: Sequence[Result]) -> str:
    """Return tables of what was found, beside the benchmark's homes."""
    ours = [result.likeness for result in results]
    theirs = [like(load_layout(path)) for path in sorted(SCENES_DIR.glob("home_*.toml"))]
    good, drawn = sum(not r.problems for r in results), sum(r.tasks for r in results)
    seconds = sorted(result.seconds for result in results)
    lines = [
        f"{good:,} of {len(results):,} homes can be played; the planner solves {sum(r.solved for r in results):,} of "
        f"{drawn:,} tasks drawn, first draws",
        f"seconds of processor time to make one: median {seconds[len(seconds) // 2]:.2f}, most {seconds[-1]:.2f}",
        f"{len({home['graph'] for home in ours})} distinct graphs of rooms; the benchmark's {len(theirs)} homes have "
        f"{len({home['graph'] for home in theirs})}",
        "",
        "| figure | generated: mean (least to most) | benchmark: mean (least to most) |",
        "|---|--:|--:|",
    ]
    for figure in [key for key in ours[0] if isinstance(ours[0][key], float | int)]:
        lines.append(f"| {figure} | {_spread(ours, figure)} | {_spread(theirs, figure)} |")
    lines += ["", "| class | in a generated home | in a benchmark home |", "|---|--:|--:|"]
    for name in sorted({name for home in (*ours, *theirs) for name in home["classes"]}):
        lines.append(f"| {name} | {_count(ours, name):.2f} | {_count(theirs, name):.2f} |")
    lines += [f"{result.seed}: {problem}" for result in results for problem in (*result.problems, *result.unsolved)]
    return "\n".join(lines)


def _spread(homes: Sequence[Likeness], figure: str) -> str:
    values = [home[figure] for home in homes if figure in home]
    return f"{np.mean(values):.1f} ({min(values):g} to {max(values):g})" if values else "-"


def _count(homes: Sequence[Likeness], name: str) -> float:
    return float(np.mean([home["classes"].get(name, 0) for home in homes]))


def main() -> None:
    """Parse the command line, examine the homes that are missing, and print the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--homes", type=int, default=1000, help="how many seeds, from 0 on (default: %(default)s)")
    parser.add_argument("--tasks", type=int, default=3, help="tasks drawn for each (default: %(default)s)")
    parser.add_argument("--results", type=Path, default=RESULTS, help="kept results (default: %(default)s)")
    options = parser.parse_args()
    os.environ["CHMARL_CACHE"] = "off"  # views of homes that nobody enters again
    known = {}
    if options.results.is_file():
        rows = map(json.loads, options.results.read_text().splitlines())
        known = {row["seed"]: Result(**row) for row in rows if row["tasks"] == options.tasks}
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.homes):
            if seed not in known:
                known[seed] = examine(seed, options.tasks, Path(folder))
                append_line(options.results, json.dumps(asdict(known[seed])))
    print(report([known[seed] for seed in range(options.homes)]))


if __name__ == "__main__":
    main()
