"""The belief search: probabilities of where X and Y are, and for each robot the look that is worth most.

It knows what the robots see, what the messages say, and what homes of training have taught. What is in view it reads
from the scene graph, as the search policy does; with pictures it is told the truth, which a learner would have to
recognise first. Feedback is not used, and nothing is drawn at random.
"""

from typing import Any, Protocol

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.policies.belief.scouts import MOVES, Scouts
from chmarl_pb.policies.belief.searcher import Searcher
from chmarl_pb.policies.belief.statistics import statistics
from chmarl_pb.policies.policy import Actions, Infos, Observations, grasps
from chmarl_pb.policies.search import SearchPolicy
from chmarl_pb.tasks.language import read_pairs


class Scout:
    """Drives one robot that flies, by the common plan."""

    def __init__(
        self, name: str, actions: tuple[str, ...], rooms: tuple[str, ...], flyers: tuple[str, ...], known: Catalog
    ):
        """Get to know the robots that fly, of which it is one."""
        self.name, self.actions, self.rooms, self._flyers, self._catalog = name, actions, rooms, flyers, known
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; nothing is drawn at random."""
        self._scouts: Scouts | None = None

    def act(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int:
        """Return the number of the next action."""
        pairs, expected = read_pairs(observation["instruction"], self._catalog), statistics(self.rooms)
        targets = {target for _, target in pairs}
        if self._scouts is None:
            self._scouts = Scouts(self._flyers, expected, len(pairs) > 1)
        self._scouts.hear(observation["messages"] > 0)
        self._scouts.decide((expected.objects_off(targets), expected.receptacles_of(targets)))
        return self.actions.index(self._scouts.actions[self.name])


class _Part(Protocol):
    def reset(self, seed: int | None) -> None: ...

    def act(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int: ...


class BeliefPolicy:
    """All robots, each by an object of its own that gets its own observation and info alone.

    Attributes:
        parts: robot -> what drives it; one that neither grasps nor flies searches as in the search policy.
    """

    def __init__(
        self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], known: Catalog = BENCHMARK,
        alone: bool = False,
    ):  # fmt: skip
        """Make the team.

        Args:
            actions: robot -> names of its actions.
            rooms: names of the rooms.
            known: the classes that instructions name.
            alone: whether robots that grasp count on nobody else's views.
        """
        graspers = [name for name, names in actions.items() if grasps(names)]
        flyers = tuple(name for name, names in actions.items() if MOVES.keys() <= set(names) and name not in graspers)
        self.parts: dict[str, _Part] = {**SearchPolicy(actions, rooms, known).searches}
        for number, name in enumerate(graspers):
            counted = () if alone else flyers
            self.parts[name] = Searcher(actions[name], rooms, counted, (number, len(graspers)), known)
        for name in flyers:
            self.parts[name] = Scout(name, actions[name], rooms, flyers, known)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        for part in self.parts.values():
            part.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action, each from its own observation and info alone."""
        return {name: self.parts[name].act(seen, infos[name]) for name, seen in observations.items()}
