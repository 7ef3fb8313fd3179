"""Search where to point without looking, on homes of training: ``python -m tools.build_spots``.

For the rooms' anchors, and after turns there, it is found which object and which receptacle has most pixels in each
cell of the picture. From it come, for Picks and Places that point, the blind policy's spots, best first, and one tour
of the open-loop policy for each class of Y.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from functools import partial
from itertools import product
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from chmarl_pb import catalog
from chmarl_pb.evaluation.drawn import stream_tasks
from chmarl_pb.files import write_atomically
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.policies.spots import FILE, Spot
from chmarl_pb.robots.pointing import GRID, cell_of
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.simulations import Simulations
from chmarl_pb.tasks.task import Task

_TASKS, _DRAW = 200, 7  # of the endless split, in 20 homes
_ROOMS = catalog.ROOM_KINDS
_TURNS = tuple(range(-HEADINGS // 2 + 1, HEADINGS // 2 + 1))  # to the left
_RECEPTACLES = list(catalog.BENCHMARK.receptacles)
_MOST = 40  # spots of each kind
_LONGEST = 60  # actions of a tour

Bools = NDArray[np.bool_]


class Shown(NamedTuple):
    """What n tasks show at (room, turn, row, column).

    Attributes:
        item: (n, rooms, turns, GRID, GRID) whether X is taken there.
        other: the same of another object.
        receptacle: the same, number of the class of the receptacle that is taken, -1 for none.
        target: (n,) number of the class of Y.
    """

    item: Bools
    other: Bools
    receptacle: NDArray[np.int8]
    target: NDArray[np.int8]

    @property
    def on_target(self) -> Bools:
        """Whether a Y is taken."""
        return np.asarray(self.receptacle == self.target[:, None, None, None, None])


def shown(simulation: Simulation, task: Task) -> tuple[Bools, Bools, NDArray[np.int8]]:
    """Return what one task shows, see :class:`Shown`."""
    shape = (len(_ROOMS), len(_TURNS), GRID, GRID)
    item, other, receptacle = np.zeros(shape, bool), np.zeros(shape, bool), np.full(shape, -1, np.int8)
    goal, robot = simulation.begin(task).goal, simulation.oracle.robot
    assert simulation.pointer is not None
    for (number, room), (place, turned) in product(enumerate(_ROOMS), enumerate(_TURNS)):
        position, heading = divmod(simulation.space.lattice.anchors[room], HEADINGS)
        robot.spawn(position * HEADINGS + (heading + turned) % HEADINGS)
        for verb in ("pick", "place"):
            for action, thing in _pointed(simulation, verb).items():
                where = (number, place, *(cell_of(action) or (0, 0)))
                if verb == "place":
                    receptacle[where] = _RECEPTACLES.index(catalog.class_of(thing))
                elif thing == goal.item:
                    item[where] = True
                else:
                    other[where] = True
    return item, other, receptacle


def _pointed(simulation: Simulation, verb: str) -> dict[str, str]:
    assert simulation.pointer is not None
    return simulation.pointer.shown(simulation.oracle.robot.name, verb)


def gather(tasks: Sequence[Task]) -> Shown:
    """Return what tasks show."""
    simulations, rows = Simulations(partial(Simulation, pointing=True), 1), []
    try:
        for task in track(tasks, "views"):
            rows.append(shown(simulations.enter(task.home), task))
    finally:
        simulations.close()
    item, other, receptacle = (np.stack(column) for column in zip(*rows, strict=True))
    return Shown(item, other, receptacle, np.array([_RECEPTACLES.index(task.target) for task in tasks], np.int8))


def spots(found: Bools) -> list[Spot]:
    """Return spots in the order of how much each adds to what the ones before it find, for the steps that it takes."""
    left, chosen = np.ones(len(found), bool), list[Spot]()
    while len(chosen) < _MOST and left.any():
        gains = found[left].sum(axis=0) / len(found)
        costs = np.array([[_steps(chosen[-1:], room, turned) for turned in _TURNS] for room in _ROOMS])
        worth = gains / costs[..., None, None]
        room, place, *cell = np.unravel_index(int(worth.argmax()), worth.shape)
        if not worth.max():
            break
        chosen.append(Spot(_ROOMS[room], _TURNS[place], (int(cell[0]), int(cell[1]))))
        left &= ~found[:, room, place, cell[0], cell[1]]
    return chosen


def _steps(before: Sequence[Spot], room: str, turned: int) -> int:
    """Return the steps to try a spot after another one."""
    ways = [1 + abs(turned)]
    ways += [abs(turned - spot.turned) for spot in before if spot.room == room]
    return 1 + min(ways)


def tour(views: Shown, target: int, longest: int = _LONGEST) -> Iterator[str]:
    """Yield the actions of a tour for a class of Y: Picks and, after each or two of them, a Place."""
    left, length = np.ones(len(views.item), bool), 0
    on = (views.receptacle == target).mean(axis=0)
    costs = 2 + np.abs(np.array(_TURNS))[None, :, None, None]
    while length < longest:
        found = views.item[left].sum(axis=0) / len(left)
        pick, place = _best_pair(found, on, costs)
        if pick is None or place is None:
            return
        for spot, verb in ((pick, "pick"), (place, "place")):
            actions = spot.actions(verb)
            length += len(actions)
            yield from actions
        left &= ~views.item[:, _ROOMS.index(pick.room), _TURNS.index(pick.turned), pick.cell[0], pick.cell[1]]


def _best_pair(
    found: NDArray[np.float64], on: NDArray[np.float64], costs: NDArray[np.int64]
) -> tuple[Spot | None, Spot | None]:
    """Return where to pick and where to place, for the greatest chance a step."""
    best: tuple[float, Spot | None, Spot | None] = 0.0, None, None
    for first, second in product(_per_cost(found, costs), _per_cost(on, costs)):
        rate = first[0] * second[0] / (first[1] + second[1])
        if rate > best[0]:
            best = rate, first[2], second[2]
    return best[1:]


def _per_cost(chance: NDArray[np.float64], costs: NDArray[np.int64]) -> list[tuple[float, int, Spot]]:
    """Return for each number of steps the best chance within them, the steps and the spot."""
    rows = []
    for steps in np.unique(costs).tolist():
        within = np.where(costs == steps, chance, 0.0)
        room, place, row, column = np.unravel_index(int(within.argmax()), within.shape)
        spot = Spot(_ROOMS[room], _TURNS[place], (int(row), int(column)))
        rows.append((float(within.max()), steps, spot))
    return rows


def build(views: Shown) -> dict[str, object]:
    """Return the spots of the blind policy and the tours of the open-loop one, as plain data."""
    tours = {name: " ".join(tour(views, number)) for number, name in enumerate(_RECEPTACLES)}
    return {
        "pick": [str(spot) for spot in spots(views.item)], "place": [str(spot) for spot in spots(views.on_target)],
        "tours": {name: line for name, line in tours.items() if line},
    }  # fmt: skip


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the spots."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=FILE, metavar="FILE.json", help="default: %(default)s")
    options = parser.parse_args(arguments)
    write_atomically(options.out, json.dumps(build(gather(stream_tasks(_TASKS, _DRAW))), indent=1) + "\n")
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
