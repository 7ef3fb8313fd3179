"""Speed of the environments on this machine: steps, frames, resets, memory; one process, random policy."""

import json
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from chmarl_pb.envs.parallel import AGENTS, HouseholdEnv
from chmarl_pb.tasks.splits import load_tasks

RUNS = 5
_WARM_UP, _COUNTED = 300, 500  # joint steps
_SPLIT = "test-unseen"


@dataclass(frozen=True)
class Row:
    """One measured figure: the median of ``RUNS`` runs, with the least and the greatest."""

    name: str
    unit: str
    median: float
    least: float
    greatest: float


def bench(runs: int = RUNS) -> Iterator[Row]:
    """Yield the figures one after the other.

    Args:
        runs: how often each is measured.
    """
    with_graphs = HouseholdEnv(split=_SPLIT)
    yield _row("scene graph, both robots", "joint steps/s", partial(_steps_per_second, with_graphs), runs)
    yield _row("reset", "resets/s", partial(_resets_per_second, with_graphs), runs)
    yield _row("planner, one task", "ms", partial(_planning_milliseconds, with_graphs), runs)
    with_graphs.close()
    for size in (64, 128, 224):
        env = HouseholdEnv("visual", split=_SPLIT, image_size=size)
        row = _row(f"visual, two {size} px views", "joint steps/s", partial(_steps_per_second, env), runs)
        yield row
        yield Row(row.name, "frames/s", *(len(AGENTS) * value for value in (row.median, row.least, row.greatest)))
        env.close()
    for observation in ("scene_graph", "visual"):
        yield _row(f"memory of one more environment, {observation}", "MB", partial(_memory, observation), min(runs, 3))


def _row(name: str, unit: str, measure: Callable[[], float], runs: int) -> Row:
    values = [measure() for _ in range(runs)]
    return Row(name, unit, statistics.median(values), min(values), max(values))


def _steps_per_second(env: HouseholdEnv) -> float:
    """Return joint steps a second of a random policy, resets included, once views are warm."""
    rng = np.random.default_rng(0)
    env.reset(seed=0)
    _play(env, rng, _WARM_UP)
    start = time.perf_counter()
    _play(env, rng, _COUNTED)
    return _COUNTED / (time.perf_counter() - start)


def _play(env: HouseholdEnv, rng: np.random.Generator, steps: int) -> None:
    counts = {name: len(names) for name, names in env.action_names.items()}
    for _ in range(steps):
        if not env.agents:
            env.reset()
        env.step({name: int(rng.integers(count)) for name, count in counts.items()})


def _resets_per_second(env: HouseholdEnv) -> float:
    env.reset(seed=0)
    start = time.perf_counter()
    for _ in range(50):
        env.reset()
    return 50 / (time.perf_counter() - start)


def _planning_milliseconds(env: HouseholdEnv) -> float:
    """Return the median time that the planner takes for a task of the split; the first run also draws the views."""
    times = []
    for task in load_tasks(_SPLIT):
        env.reset(options={"task": task})
        start = time.perf_counter()
        env.stage.oracle.plan(env.setting.goal)
        times.append(1000 * (time.perf_counter() - start))
    return statistics.median(times)


_MEMORY = """
import os, sys
from chmarl_pb.envs.parallel import HouseholdEnv
def resident():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 2**20
first = HouseholdEnv(sys.argv[1], split=sys.argv[2]); first.reset(seed=0)
before = resident()
more = [HouseholdEnv(sys.argv[1], split=sys.argv[2]) for _ in range(5)]
for number, env in enumerate(more):
    env.reset(seed=number)
print((resident() - before) / len(more))
"""


def _memory(observation: str) -> float:
    """Return the resident memory in MB that an environment adds to a process that has one already (Linux)."""
    if not Path("/proc/self/statm").is_file():
        return float("nan")
    command = [sys.executable, "-c", _MEMORY, observation, _SPLIT]
    return float(subprocess.run(command, capture_output=True, text=True, check=True).stdout.split()[-1])


def run(out: Path | None) -> int:
    """Measure, print a table, and write the figures as JSON if a file is given."""
    console = Console()
    table = Table(title=f"chmarl_pb on {platform.processor() or platform.machine()}, {os.cpu_count()} cores")
    for column in ("figure", "median", "least", "greatest", "unit"):
        table.add_column(column, justify="left" if column in ("figure", "unit") else "right")
    rows = []
    with console.status("measuring") as status:
        for row in bench():
            status.update(f"measured {row.name}")
            rows.append(row)
            table.add_row(row.name, *(f"{value:,.1f}" for value in (row.median, row.least, row.greatest)), row.unit)
    console.print(table)
    if out is not None:
        temporary = out.with_suffix(f".{os.getpid()}.tmp")
        temporary.write_text(json.dumps([asdict(row) for row in rows], indent=1) + "\n", encoding="utf-8")
        temporary.replace(out)
    return 0
