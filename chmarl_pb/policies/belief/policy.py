"""The belief search: probabilities of where X and Y are, and for each robot the look that is worth most.

It knows what the robots see, what the messages say, and what homes of training have taught. What is in view it reads
from the scene graph, as the search policy does; with pictures it is told the truth, which a learner would have to
recognise first. Feedback is not used, and nothing is drawn at random.
"""

from collections.abc import Collection
from typing import Any

import numpy as np

from chmarl_pb.catalog import Catalog, class_of
from chmarl_pb.policies.aiming import nodes_of
from chmarl_pb.policies.belief.guide import SPAN, Guide
from chmarl_pb.policies.belief.scouts import MOVES, STAY, Scouts
from chmarl_pb.policies.belief.searcher import Searcher
from chmarl_pb.policies.belief.statistics import statistics
from chmarl_pb.policies.code import BEARINGS, SHARED, Bearing, Guiding
from chmarl_pb.policies.expert import Team
from chmarl_pb.policies.policy import grasps
from chmarl_pb.policies.search import SearchPolicy
from chmarl_pb.policies.sights import messages_read
from chmarl_pb.tasks.language import read_pairs

_ABOVE = 0.7  # metres from a room's middle within which there is no telling a direction


class Scout:
    """Drives one robot that flies, by the common plan."""

    def __init__(
        self, name: str, actions: tuple[str, ...], rooms: tuple[str, ...], flyers: tuple[str, ...], known: Catalog,
        guided: tuple[str, ...] = (),
    ):  # fmt: skip
        """Get to know the robots that fly, of which it is one, and the class of the one that it guides, if any."""
        self.name, self.actions, self.rooms, self._flyers, self._catalog = name, actions, rooms, flyers, known
        self._guided_class = guided
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; nothing is drawn at random."""
        self._scouts: Scouts | None = None
        self._guide = Guide(self.rooms, self._guided_class, self._catalog)

    def propose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int:
        """Return the number of the action that is to be taken now."""
        pairs, expected = read_pairs(observation["instruction"], self._catalog), statistics(self.rooms)
        targets = {target for _, target in pairs}
        if self._scouts is None:
            self._scouts = Scouts(self._flyers, expected, targets, len(pairs) > 1)
        self._scouts.hear(messages_read(observation, self.rooms, self._catalog, SHARED) > 0, observation.get(BEARINGS))
        self._scouts.decide()
        action = self._scouts.actions[self.name]
        if BEARINGS in observation and "node_view" in observation and len(pairs) == 1:
            action = self._guided(action, observation, ({item for item, _ in pairs}, targets))
        return self.actions.index(action)

    def _guided(
        self, action: str, observation: dict[str, np.ndarray], names: tuple[Collection[str], Collection[str]]
    ) -> str:
        """Return what it does instead of staying, to guide."""
        assert self._scouts is not None
        place = self._scouts.before(self.name)
        board, found = observation["messages"], self._guide.see(observation, names, place)
        free = action == STAY or (found and board[1].any())
        return self._guide.action(board, place) if free else action

    def guiding(self, observation: dict[str, np.ndarray], name: str, row: int) -> float | None:
        """Return the direction of a thing in view from the robot that is to come there, see :class:`Guide`."""
        wanted = "node_view" in observation and bool(self._guide.held(observation)) == bool(row)
        return self._guide.bearing(observation, name) if wanted else None

    def note(self, action: int) -> None:
        """Go on from the action that was taken, whatever was proposed."""
        if self._scouts is not None:
            self._scouts.note(self.name, self.actions[action])

    def bearing(self, observation: dict[str, np.ndarray], name: str, room: int) -> float | None:
        """Return the direction of a thing in view from the middle of its room; None unless it flies in that room.

        If a robot that grasps is there already, it is the direction from that one.
        """
        if "node_view" in observation and self._guide.is_in(observation, self.rooms[room]):
            return self._guide.bearing(observation, name)
        place = None if self._scouts is None else self._scouts.place(self.name)
        nodes = nodes_of(observation, (name,), self._catalog)
        if place is None or place[0] != room or name not in nodes.names:
            return None
        (right, forward), (across, down, _) = place[1], nodes.views[nodes.names.index(name)]
        x, y = right + (across - 0.5) * SPAN, forward + (0.5 - down) * SPAN
        return float(np.arctan2(y, x)) if np.hypot(x, y) > _ABOVE else None


class BeliefPolicy(Team):
    """All robots, each by an object of its own that gets its own observation and info alone.

    As a policy it does what it proposes. A teacher's proposals are followed or not: each robot's object goes on from
    what that robot did. What the others do it takes from the common plan still, as its robot cannot know better, so
    that a proposal follows from what the robot itself has observed and done.

    Attributes:
        parts: robot -> what drives it; one that neither grasps nor flies searches as in the search policy.
    """

    def __init__(
        self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], known: Catalog,
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
        super().__init__(SearchPolicy(actions, rooms, known).parts)
        for number, name in enumerate(graspers):
            counted = () if alone else flyers
            self.parts[name] = Searcher(actions[name], rooms, counted, (number, len(graspers)), known)
        guided = tuple(map(class_of, graspers)) if len(graspers) == 1 else ()
        for name in flyers:
            self.parts[name] = Scout(name, actions[name], rooms, flyers, known, guided)

    @property
    def bearings(self) -> dict[str, tuple[Bearing, Guiding]]:
        """Robot that flies -> what tells directions, from rooms' middles and from robots."""
        return {name: (part.bearing, part.guiding) for name, part in self.parts.items() if isinstance(part, Scout)}
