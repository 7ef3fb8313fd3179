"""Check generated homes and tell what they are like, beside the benchmark's: ``python -m benchmarks.generated``.

Each home is made from its seed, checked, and tasks are drawn for it as environments draw them: anew until the planner
solves one. Results are kept, one line a home, so that a run that was stopped goes on where it was; it says how many
are of other code.
"""

import argparse
import json
import os
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from copy import deepcopy
from dataclasses import asdict, dataclass
from itertools import permutations, product
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.kept import warn_of_other_code
from chmarl_pb.assets import SCENES_DIR
from chmarl_pb.catalog import BENCHMARK, room_kind
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import TaskError
from chmarl_pb.evaluation.provenance import source_hash
from chmarl_pb.files import append_line
from chmarl_pb.homes.furniture import load_model
from chmarl_pb.homes.generate.store import generate_home
from chmarl_pb.homes.layout import Layout, load_layout
from chmarl_pb.navigation.check import check_home
from chmarl_pb.tasks.sampling import sample_task
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.source import draw_solvable
from chmarl_pb.tasks.task import Task

RESULTS = Path(__file__).parents[1] / "out" / "generated.jsonl"
_WARM = 10**6  # a seed whose home is made and entered before: what is imported and compiled counts for no home
_KEPT = ("seed", "problems", "tasks", "solved", "unsolved")
Likeness = dict[str, Any]  # numbers, the text of the graph of rooms, and how many of each class


@dataclass(frozen=True)
class Result:
    """What was found about the home of a seed.

    Attributes:
        seed: of the home.
        seconds: processor time that making it took, URDF included.
        reset: processor time from its files to the end of the first reset, without kept views.
        problems: why it cannot be played; empty if it can.
        tasks: how many an environment would have played, each solved by the planner.
        solved: of them, how many are what was drawn first.
        unsolved: why the first draws of the others were drawn again.
        likeness: what the home is like.
        source_sha256: of the package's code that found it; "": not known.
    """

    seed: int
    seconds: float
    reset: float
    problems: tuple[str, ...]
    tasks: int
    solved: int
    unsolved: tuple[str, ...]
    likeness: Likeness
    source_sha256: str = ""


def examine(seed: int, tasks: int) -> Result:
    """Make a home, enter it, check it, draw tasks and solve them.

    Args:
        seed: of the home.
        tasks: how many are drawn.
    """
    path, seconds, reset = _enter(seed)
    problems = tuple(map(str, check_home(path).problems))
    played, again = 0, list[str]()
    if not problems and tasks:
        try:
            for reason in _draw(path, seed, tasks):
                played += 1
                again += [reason] if reason else []
        except TaskError as error:
            problems = (str(error),)
    path.unlink()
    likeness = like(load_layout(path.with_suffix(".toml")))
    found = played - len(again), tuple(again), likeness
    return Result(seed, seconds, reset, problems, played, *found, source_hash())


def _enter(seed: int) -> tuple[Path, float, float]:
    """Make a home and play up to its first reset; return its URDF and the processor time of both."""
    start = time.process_time()
    path = generate_home(seed)
    middle = time.process_time()
    env = HouseholdEnv(home=path)
    env.reset(seed=seed)
    end = time.process_time()
    env.close()
    return path, middle - start, end - middle


def _draw(path: Path, seed: int, tasks: int) -> Iterator[str]:
    """Draw tasks as an environment does, and yield for each why the first draw of it cannot be solved, if so.

    Raises:
        TaskError: no draw can be solved.
    """
    simulation, rng = Simulation(str(path)), np.random.default_rng(seed)
    try:
        for _ in range(tasks):
            first = sample_task(simulation.space, str(path), deepcopy(rng))
            task = draw_solvable(simulation, str(path), rng)
            yield "" if task.seed == first.seed else _why_not(simulation, first)
    finally:
        simulation.close()


def _why_not(simulation: Simulation, task: Task) -> str:
    try:
        simulation.solve(task)
    except TaskError as error:
        return f"{task.graspable}, {task.source} to {task.target}: {error}"
    raise AssertionError(f"{task} is solved at times")


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
    good, played = sum(not r.problems for r in results), sum(r.tasks for r in results)
    lines = [
        f"{good:,} of {len(results):,} homes can be played; {played:,} tasks are solved by the planner, "
        f"{sum(r.solved for r in results):,} of them as drawn first",
        f"seconds of processor time to make one: {_times([result.seconds for result in results])}",
        f"seconds of processor time from its files to the first reset: {_times([result.reset for result in results])}",
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


def _times(seconds: Sequence[float]) -> str:
    middle, late, most = np.percentile(seconds, (50, 95, 100))
    return f"median {middle:.2f}, 95 per cent {late:.2f}, most {most:.2f}"


def _spread(homes: Sequence[Likeness], figure: str) -> str:
    values = [home[figure] for home in homes if figure in home]
    return f"{np.mean(values):.1f} ({min(values):g} to {max(values):g})" if values else "-"


def _count(homes: Sequence[Likeness], name: str) -> float:
    return float(np.mean([home["classes"].get(name, 0) for home in homes]))


def _is_of(row: dict[str, Any], tasks: int) -> bool:
    """Return whether a kept row is a result as they are now, with so many tasks."""
    return "reset" in row and bool(row["problems"] or row["tasks"] == tasks)


def main() -> None:
    """Parse the command line, examine the homes that are missing, and print the report."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--homes", type=int, default=1000, help="how many seeds, from 0 on (default: %(default)s)")
    parser.add_argument("--tasks", type=int, default=3, help="tasks of each (default: %(default)s)")
    parser.add_argument("--json", type=Path, help="file for what became of each home and its tasks")
    parser.add_argument("--results", type=Path, default=RESULTS, help="kept results (default: %(default)s)")
    options = parser.parse_args()
    os.environ["CHMARL_CACHE"] = "off"  # views of homes that nobody enters again
    known = {}
    if options.results.is_file():
        rows = map(json.loads, options.results.read_text().splitlines())
        known = {row["seed"]: Result(**row) for row in rows if _is_of(row, options.tasks)}
    warn_of_other_code(options.results, map(asdict, known.values()))
    options.results.parent.mkdir(parents=True, exist_ok=True)
    if len(known) < options.homes:
        _enter(_WARM)
    for seed in range(options.homes):
        if seed not in known:
            known[seed] = examine(seed, options.tasks)
            append_line(options.results, json.dumps(asdict(known[seed])))
    results = [known[seed] for seed in range(options.homes)]
    print(report(results))
    if options.json:
        lines = [json.dumps({key: getattr(result, key) for key in _KEPT}) for result in results]
        options.json.write_text("[\n" + ",\n".join(lines) + "\n]\n", encoding="utf-8")


if __name__ == "__main__":
    main()
