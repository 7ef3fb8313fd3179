"""Draw tasks: uniformly over what fits in a home, with no idea of where things usually lie."""

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.errors import TaskError
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.tasks.task import Task

_SEEDS = 2**31 - 1
#: Draws of classes until all objects may stand where they are to.
DRAWS = 1000


def sample_task(space: Space, home: str, rng: np.random.Generator, task_id: str | None = None) -> Task:
    """Draw a graspable, a source and a target class, and a seed; whether it can be solved is not asked.

    Args:
        space: of the home.
        home: the home's name or path, as the task is to name it.
        rng: source of randomness.
        task_id: the task's id; made of the home's name and the task's seed if None.

    Raises:
        TaskError: the home has receptacles of less than two classes, or none for any object.
    """
    classes, known = receptacle_classes(space, 2), space.home.catalog
    for _ in range(DRAWS):
        source, target = map(str, rng.choice(classes, size=2, replace=False))
        graspable = str(rng.choice(list(known.graspables)))
        if may_stand(known, graspable, source, target):
            seed = sample_seed(rng)
            return Task(task_id or f"{space.home.name}-{seed}", home, graspable, source, target, seed)
    raise TaskError(f"{space.home.path}: no object was found that may stand on two of its classes; widen 'places'")


def may_stand(known: Catalog, graspable: str, *receptacles: str) -> bool:
    """Tell whether tasks put things of a class on receptacles of these classes."""
    places = known.graspables[graspable].places
    return not places or set(receptacles) <= set(places)


def receptacle_classes(space: Space, least: int) -> list[str]:
    """Return the classes of a home's receptacles, sorted.

    Raises:
        TaskError: there are fewer than ``least``.
    """
    classes = sorted({thing.class_name for thing in space.home.receptacles.values()})
    if len(classes) < least:
        raise TaskError(f"{space.home.path}: a task needs receptacles of at least {least} classes; add furniture")
    return classes


def sample_seed(rng: np.random.Generator) -> int:
    """Draw the seed of a task."""
    return int(rng.integers(_SEEDS))
