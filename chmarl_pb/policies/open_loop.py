"""The open-loop policy: a fixed tour for each class of Y; it never looks, hears or gets feedback, and has no partner.

The tours were searched on the homes of training: ``python -m tools.build_tours``.
"""

import json
from collections.abc import Iterator, Sequence
from functools import cache
from itertools import chain, cycle
from pathlib import Path

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies import spots
from chmarl_pb.policies.aiming import number_of
from chmarl_pb.policies.policy import Actions, Infos, Observations, grasps
from chmarl_pb.tasks.language import read_pairs

FILE = Path(__file__).parent / "open_loop.json"


class OpenLoopPolicy:
    """Reads the instruction once and plays the tour of its Y to the end, over and over; who cannot grasp stays."""

    def __init__(self, actions: dict[str, tuple[str, ...]], known: Catalog):
        """Remember the names of each robot's actions, and the classes that instructions name."""
        self.actions, self._catalog = actions, known
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self._tours: dict[str, Iterator[str]] = {}

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action."""
        for robot in observations.keys() - self._tours.keys():
            self._tours[robot] = self._begin(robot, observations[robot]["instruction"])
        return {robot: number_of(self.actions[robot], next(self._tours[robot])) for robot in observations}

    def _begin(self, robot: str, instruction: np.ndarray) -> Iterator[str]:
        if not grasps(self.actions[robot]):
            return cycle(["stay"])
        (_, target), *_ = read_pairs(instruction, self._catalog)
        known = tours() if "pick" in self.actions[robot] else spots.tours()
        tour = known.get(target, next(iter(known.values())))  # any, for a class of the user's own
        return cycle(_possible(tour, self.actions[robot]) or ["stay"])


@cache
def tours() -> dict[str, list[str]]:
    """Return class of Y -> names of the humanoid's actions."""
    return {target: line.split() for target, line in json.loads(FILE.read_text(encoding="utf-8")).items()}


def _possible(tour: Sequence[str], actions: Sequence[str]) -> list[str]:
    """Return a tour without its visits to rooms that a home does not have."""
    visits: list[list[str]] = []
    for action in tour:
        if action.startswith("goto_") or not visits:
            visits.append([])
        visits[-1].append(action)
    return list(chain.from_iterable(visit for visit in visits if visit[0] in actions))
