"""The figures of the benchmark of speed, and how each is measured."""

import statistics
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from itertools import islice

from chmarl_pb.bench import playing, vectors
from chmarl_pb.bench.fresh import samples
from chmarl_pb.bench.playing import Effort, Samples
from chmarl_pb.errors import OptionError


@dataclass(frozen=True)
class Row:
    """One measured figure.

    Attributes:
        name: what was measured.
        unit: of the values.
        median: of all runs.
        least: of all runs.
        greatest: of all runs.
    """

    name: str
    unit: str
    median: float
    least: float
    greatest: float


@dataclass(frozen=True)
class Figure:
    """Something to measure.

    Attributes:
        name: of its rows.
        measure: effort -> endless stream of samples, each a row's unit -> value.
    """

    name: str
    measure: Callable[[Effort], Samples]


def _in_process(name: str, *arguments: object, keep: bool = False) -> Callable[[Effort], Samples]:
    return lambda effort: samples(name, *arguments, keep=keep)


_VISUAL = {size: f"visual, two {size} px views" for size in (64, 128, 224)}

FIGURES = (
    Figure("scene graph, fresh tasks", partial(playing.steps, observation="scene_graph", split="train")),
    Figure("scene graph, the same 50 tasks", partial(playing.steps, observation="scene_graph")),
    Figure("visual, two 128 px views, fresh tasks", partial(playing.steps, observation="visual", split="train")),
    *(Figure(name, partial(playing.steps, observation="visual", size=size)) for size, name in _VISUAL.items()),
    Figure("scene graph, pointing", partial(playing.steps, observation="scene_graph", split="train", pointing=True)),
    Figure("visual, two 128 px views, pointing", partial(playing.steps, observation="visual", pointing=True)),
    Figure("visual, 128 px, first visits", _in_process("first_visits", 128, 200)),
    Figure("reset", playing.resets),
    Figure("URDF files loaded after the first reset of each home", _in_process("loads", 25)),
    Figure("memory of one more environment, scene graph", _in_process("memory", "scene_graph")),
    Figure("memory of one more environment, visual", _in_process("memory", "visual")),
    Figure("vector environment, scene graph", partial(vectors.processes, observation="scene_graph")),
    Figure("vector environment, two 128 px views", partial(vectors.processes, observation="visual")),
    Figure("vector beside AsyncVectorEnv, scene graph", partial(vectors.beside_gymnasium, observation="scene_graph")),
    Figure("vector beside AsyncVectorEnv, two 128 px views", partial(vectors.beside_gymnasium, observation="visual")),
    Figure('execution="simulated"', playing.driving),
    Figure("import chmarl_pb", _in_process("importing")),
    Figure("first reset of a home, empty view store", _in_process("first_reset")),
    Figure("first reset of a home, filled view store", _in_process("first_reset", keep=True)),
    Figure("a new home every 100 episodes, scene graph", _in_process("new_homes", 3, 100)),
    Figure("planner, one task", playing.planning),
)


def chosen(only: Sequence[str]) -> list[Figure]:
    """Return the figures whose names contain one of the texts; all if there are no texts.

    Raises:
        OptionError: no figure has such a name.
    """
    found = [figure for figure in FIGURES if not only or any(text.lower() in figure.name.lower() for text in only)]
    if not found:
        raise OptionError(f"no figure is named like {list(only)}; the names: {'; '.join(row.name for row in FIGURES)}")
    return found


def measure(figure: Figure, effort: Effort, progress: Callable[[], object] = lambda: None) -> Iterator[Row]:
    """Yield the rows of a figure.

    Args:
        figure: what to measure.
        effort: how long.
        progress: called after every run.
    """
    taken = []
    with closing(figure.measure(effort)) as stream:
        for sample in islice(stream, effort.runs):
            taken.append(sample)
            progress()
    for unit in taken[0]:
        values = [sample[unit] for sample in taken]
        yield Row(figure.name, unit, statistics.median(values), min(values), max(values))
