"""Tasks that are drawn for a home of the user's or of the endless split, to be played like those of a fixed one."""

from functools import lru_cache, partial
from typing import Any

import numpy as np

from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.provenance import robots_hash
from chmarl_pb.homes.home import load_home
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.simulations import Simulations
from chmarl_pb.tasks.source import TaskSource, draw_solvable
from chmarl_pb.tasks.splits import STREAM
from chmarl_pb.tasks.task import Task

_IN_A_HOME = 10  # tasks of the endless split that are drawn in each home, as many as in those of generated-val
_MOST_HOMES = 10**6  # of one draw, so that draws of other seeds have others


def draw_tasks(home: str, count: int, seed: int = 0, *, seeds_from: int = 0, **options: Any) -> tuple[Task, ...]:
    """Return tasks that the planner solves in a home; the same arguments give the same tasks.

    Args:
        home: name or path.
        count: how many.
        seed: of the draw.
        seeds_from: least seed of a task; from 2**31 on they are none that an environment draws.
        **options: of the environment that they are to be solved in: ``robots``, ``catalog``, and ``lookalikes`` or
            ``track``, which say whether there are lookalikes.

    Raises:
        OptionError: the number is not positive, or an option has a value that it does not know.
        HomeError: the home cannot be used.
        TaskError: the home offers no task that can be solved.
    """
    if count < 1:
        raise OptionError(f"{count} tasks: draw at least one")
    setting = Options(home=home, **options)
    files = load_home(home, setting.things).content, *_files(setting)
    return _draw_tasks(files, home, count, seed, setting, seeds_from)


def _files(options: Options) -> tuple[object, ...]:
    """Return what the files of robots and things hold: draws are kept only while these and the home are the same."""
    return options.things.content, *sorted(robots_hash(options.models.values()).items())


@lru_cache(maxsize=16)
def _draw_tasks(
    files: tuple[object, ...], home: str, count: int, seed: int, options: Options, seeds_from: int
) -> tuple[Task, ...]:  # fmt: skip
    rng = np.random.default_rng(seed)
    simulation = Simulation(home, options.models, known=options.things, lookalikes=options.lookalikes)
    try:
        name = simulation.home.name
        draw = f"drawn-{name}-{seed}" if seed else f"drawn-{name}"
        ids = [f"{draw}-{number:03d}" for number in range(count)]
        tasks = [draw_solvable(simulation, home, rng, task_id, seeds_from=seeds_from) for task_id in ids]
    finally:
        simulation.close()
    return tuple(task for task in tasks if isinstance(task, Task))


def stream_tasks(count: int, seed: int = 0, **options: Any) -> tuple[Task, ...]:
    """Return tasks of the endless split, ten in each home: each is what ``reset`` plays with some seed.

    Args:
        count: how many.
        seed: of the draw.
        **options: of the environment that they are to be solved in: ``robots`` and ``catalog``.

    Raises:
        TaskError: several homes in a row offer no task that can be solved.
    """
    setting = Options(split=STREAM, **options)
    return _stream_tasks(_files(setting), count, seed, setting)


@lru_cache(maxsize=16)
def _stream_tasks(files: tuple[object, ...], count: int, seed: int, options: Options) -> tuple[Task, ...]:
    source = TaskSource(STREAM, None, options.kind, options.things)
    simulations, tasks = Simulations(partial(Simulation, models=options.models, known=options.things), 1), []
    try:
        for number in range(count):
            home = seed * _MOST_HOMES + number // _IN_A_HOME
            own = home * source.episodes_in_a_home + number % _IN_A_HOME
            source.begin(own)
            tasks.append(source.draw(np.random.default_rng(own), simulations.enter))
    finally:
        simulations.close()
    return tuple(task for task in tasks if isinstance(task, Task))
