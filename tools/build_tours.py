"""Search the tours of the open-loop policy on the homes of training: ``python -m tools.build_tours``.

For each class of Y a beam search finds the actions that score best over objects X where training tasks put them.
What is asked of the homes is only which classes are in view from the rooms' anchors and from where X is picked.
"""

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from chmarl_pb import catalog
from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.files import write_atomically
from chmarl_pb.navigation.lattice import HEADINGS
from chmarl_pb.policies.open_loop import FILE
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task

Bools = NDArray[np.bool_]

_TASKS = 1000  # of training, from the first
_BEAM = 12  # tours of each length that are tried further
_TYPICAL = 6  # joint steps of the planner: L* is 6.1 on average in training
_HOPE = 0.65  # what a picked object counts of the score that placing it in three steps would bring
_TURNS = range(-HEADINGS // 2 + 1, HEADINGS // 2 + 1)  # to the left
_RECEPTACLES = np.array(list(catalog.BENCHMARK.receptacles))


@dataclass(frozen=True)
class Views:
    """What is in view, for n objects X: from each room's anchor, from where X is picked, and from nowhere.

    Attributes:
        rooms: in the order of their anchors.
        item: (n, rooms + 2, HEADINGS) whether X is, after so many turns to the left.
        target: (n, rooms + 2, HEADINGS) whether a Y is.
    """

    rooms: tuple[str, ...]
    item: Bools
    target: Bools


@dataclass(frozen=True)
class Tour:
    """Actions, and how far n tasks are after them.

    Attributes:
        actions: so far.
        place: (n,) where the robot stands: a room, where X was picked, or nowhere that is known.
        turned: (n,) turns to the left since.
        holding: (n,) whether X has been picked.
        score: (n,) of the tasks that are solved, else 0.
    """

    actions: tuple[str, ...]
    place: NDArray[np.int64]
    turned: NDArray[np.int64]
    holding: Bools
    score: NDArray[np.float64]

    @property
    def value(self) -> float:
        """What the tour is worth: its score, and some of that which the picked objects may still bring."""
        soon = len(self.actions) + 3
        hope = _HOPE * _score(soon) if soon <= MAX_STEPS else 0.0
        return float(self.score.sum() + hope * (self.holding & (self.score == 0)).sum())


def _score(steps: int) -> float:
    return _TYPICAL / max(steps, _TYPICAL)


def extended(tour: Tour, action: str, views: Views) -> Tour:
    """Return a tour with one action more."""
    actions, everyone = (*tour.actions, action), np.arange(len(tour.place))
    if action.startswith("goto_"):
        room = views.rooms.index(action.removeprefix("goto_"))
        return replace(tour, actions=actions, place=np.full_like(tour.place, room), turned=np.zeros_like(tour.turned))
    if action in ("turn_left", "turn_right"):
        turned = (tour.turned + (1 if action == "turn_left" else -1)) % HEADINGS
        return replace(tour, actions=actions, turned=turned)
    if action == "pick":
        picked = ~tour.holding & views.item[everyone, tour.place, tour.turned]
        place, turned = np.where(picked, len(views.rooms), tour.place), np.where(picked, 0, tour.turned)
        return replace(tour, actions=actions, place=place, turned=turned, holding=tour.holding | picked)
    placed = tour.holding & (tour.score == 0) & views.target[everyone, tour.place, tour.turned]
    return replace(tour, actions=actions, score=np.where(placed, _score(len(actions)), tour.score))


def best_tour(views: Views, beam: int = _BEAM, steps: int = MAX_STEPS) -> Tour:
    """Return the best tour that a beam search finds."""
    count = len(views.item)
    nowhere = np.full(count, len(views.rooms) + 1)
    start = Tour((), nowhere, np.zeros(count, dtype=int), np.zeros(count, dtype=bool), np.zeros(count))
    tours: list[list[Tour]] = [[start], *([] for _ in range(steps))]  # by length
    best = start
    for same in tours:
        for tour in sorted(same, key=lambda tour: -tour.value)[:beam]:
            best = max(best, tour, key=lambda tour: tour.score.sum())
            for further in _further(tour, views):
                if len(further.actions) <= steps:
                    tours[len(further.actions)].append(further)
        same.clear()
    return best


def _further(tour: Tour, views: Views) -> Iterator[Tour]:
    """Yield the tour with one try more: here or in a room, after some turns, to pick or to place."""
    for visit in ([], *([f"goto_{room}"] for room in views.rooms)):
        for turns in _TURNS:
            around = tour
            for action in (*visit, *["turn_left" if turns > 0 else "turn_right"] * abs(turns)):
                around = extended(around, action, views)
            yield extended(around, "pick", views)
            yield extended(around, "place", views)


def views_of(simulation: Simulation, task: Task) -> tuple[Bools, Bools]:
    """Return what a task shows: (rooms + 2, HEADINGS) of X, and (rooms + 2, HEADINGS, receptacle classes)."""
    goal, space = simulation.begin(task).goal, simulation.space
    stand = space.stand(simulation.world.grip(goal.item))
    assert stand is not None, "tasks of the splits can be solved"
    poses = [*space.lattice.anchors.values(), stand]
    item = np.zeros((len(poses) + 1, HEADINGS), dtype=bool)
    classes = np.zeros((*item.shape, len(_RECEPTACLES)), dtype=bool)
    for place, pose in enumerate(poses):
        position, heading = divmod(pose, HEADINGS)
        for turned in range(HEADINGS):
            seen = simulation.oracle.seen_from(
                simulation.oracle.robot.name, position * HEADINGS + (heading + turned) % HEADINGS
            )
            item[place, turned] = goal.item in seen
            classes[place, turned] = np.isin(_RECEPTACLES, [catalog.class_of(name) for name in seen])
    return item, classes  # who has picked X picks no more, so that it does not count that X is in view from there


def build(tasks: Sequence[Task], beam: int = _BEAM) -> dict[str, str]:
    """Return class of Y -> the actions of its tour, with a space between them."""
    simulations = {home: Simulation(home) for home in sorted({task.home for task in tasks})}
    shown = [views_of(simulations[task.home], task) for task in track(tasks, "views")]
    rooms = next(iter(simulations.values())).rooms
    homes = {
        home: {thing.class_name for thing in simulation.home.receptacles.values()}
        for home, simulation in simulations.items()
    }
    for simulation in simulations.values():
        simulation.close()
    item, classes = np.array([one for one, _ in shown]), np.array([many for _, many in shown])
    tours = {}
    for number, target in enumerate(track(_RECEPTACLES.tolist(), "tours")):
        fits = np.array([target in homes[task.home] and task.source != target for task in tasks])
        if fits.any():
            tours[target] = " ".join(best_tour(Views(rooms, item[fits], classes[fits, ..., number]), beam).actions)
    return tours


def main(arguments: Sequence[str] | None = None) -> int:
    """Write the tours."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=FILE, metavar="FILE.json", help="default: %(default)s")
    options = parser.parse_args(arguments)
    write_atomically(options.out, json.dumps(build(load_tasks("train")[:_TASKS]), indent=1) + "\n")
    print(options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
