"""Tasks that are drawn for a home of the user's, to be played and evaluated like those of a split."""

from functools import lru_cache
from pathlib import Path

import numpy as np

from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.source import draw_solvable
from chmarl_pb.tasks.task import Task


@lru_cache(maxsize=16)
def draw_tasks(
    home: str,
    count: int,
    seed: int = 0,
    catalog: str | None = None,
    robots: tuple[str | Path | RobotModel, ...] = TEAM,
) -> tuple[Task, ...]:
    """Return tasks that the planner solves in a home; the same arguments give the same tasks.

    Args:
        home: name or path.
        count: how many.
        seed: of the draw.
        catalog: catalogue file of own things.
        robots: that are to solve them.

    Raises:
        OptionError: the number is not positive.
        HomeError: the home cannot be used.
        TaskError: the home offers no task that can be solved.
    """
    if count < 1:
        raise OptionError(f"{count} tasks: draw at least one")
    options, rng = Options(home=home, robots=robots, catalog=catalog), np.random.default_rng(seed)
    simulation = Simulation(home, options.models, known=options.things)
    try:
        name = simulation.home.name
        tasks = [draw_solvable(simulation, home, rng, f"drawn-{name}-{number:03d}") for number in range(count)]
    finally:
        simulation.close()
    return tuple(task for task in tasks if isinstance(task, Task))
