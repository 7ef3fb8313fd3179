"""The search policy: it knows only what the robots see and what the messages say.

What is in view it reads from the nodes of the scene graph. Where there is none, as with pictures, it is told the truth
(``info["visible"]``), which a learner would have to recognise first.

A robot that does not grasp, as the drone, sweeps room after room; one that does, as the humanoid, goes where a message
says that the thing it needs has been seen, looks around there, and otherwise searches the rooms itself, in the opposite
order. Where there are several of a kind, they begin with different rooms.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.policies.aiming import aimed, cells_of, held_class, number_of, putting_away
from chmarl_pb.policies.expert import RobotExpert, Team
from chmarl_pb.policies.policy import grasps
from chmarl_pb.policies.sights import classes_in_view, messages_read, own_room
from chmarl_pb.policies.tidying import Tidying
from chmarl_pb.robots.pointing import Cell, verb_of
from chmarl_pb.tasks.language import read_pairs

_SIDES = ("turn_left", "turn_right")
_TURNS = 11  # after these many turns of 30 degrees a robot has seen all around
_PACES = 3  # forward moves before it looks around again
#: Moves that show a robot that flies the surroundings of a room's centre: one round of eight places.
SWEEP = (
    "move_forward", "move_left", "move_backward", "move_backward",
    "move_right", "move_right", "move_forward", "move_forward",
)  # fmt: skip


def sweep_of(actions: Sequence[str]) -> tuple[str, ...]:
    """Return the moves by which a robot with these actions looks at the surroundings of where it is."""
    return SWEEP if set(SWEEP) <= set(actions) else _SIDES[:1] * _TURNS


class GrasperSearch:
    """Searches, picks and places with one robot that grasps.

    As a policy it does what it proposes. A teacher's proposals are followed or not: it goes on from what was done.
    """

    def __init__(
        self,
        actions: tuple[str, ...],
        rooms: tuple[str, ...],
        order: tuple[str, ...] | None = None,
        known: Catalog = BENCHMARK,
    ):
        """Remember the names of actions and rooms, in the order of their numbers, and the order in which to search."""
        self.actions, self.rooms, self._order, self._catalog = actions, rooms, order or rooms, known
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self._rng = np.random.default_rng(seed)
        self._looks: list[str] = []
        self._searched: set[str] = set()
        self._wanted, self._tried = frozenset[str](), ""
        self._away = False  # whether it has just put down what was picked by mistake
        self._tidying = Tidying()

    def propose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int:
        """Return the number of the action that is to be taken now; nothing counts as done before it is noted."""
        return number_of(self.actions, self._choose(observation, info))

    def note(self, action: int) -> None:
        """Go on from the action that was taken, whatever was proposed."""
        self._tried = done = verb_of(self.actions[action])
        if done.startswith("goto_"):
            self._looks = self._round()
            return
        if done in _SIDES and sum(look in _SIDES for look in self._looks) == _TURNS:  # the first turn chooses the side
            self._looks[-_TURNS:] = [done] * _TURNS
        if self._looks[-1:] == [done]:
            self._looks.pop()

    def _choose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> str:
        pairs, holding = read_pairs(observation["instruction"], self._catalog), bool(observation["self"][-1])
        board = messages_read(observation, self.rooms, self._catalog)
        cells = cells_of(observation, self._catalog)
        if cells and holding and held_class(observation, self._catalog) not in (None, *(item for item, _ in pairs)):
            return self._put_away(cells)
        seen = classes_in_view(observation, info, self._catalog)
        tried, self._away = "" if self._away else self._tried, False
        wanted = self._tidying.wanted(pairs, holding, seen, tried)
        verb, row = ("place", 1) if holding else ("pick", 0)
        if wanted != self._wanted:
            self._wanted, self._looks, self._searched = wanted, [], set()
        here = own_room(observation, self.rooms) or None
        failed = self._tried == verb
        aims = [cell for name, cell in cells.items() if name in wanted]
        if wanted & seen and not failed and (aims or "node_view" not in observation):
            return aimed(verb, aims[0] if aims else None)
        known = [room for room, bit in zip(self.rooms, board[row], strict=True) if bit]
        if len(pairs) > 1:  # the board does not say which object has been seen where
            known = self._not_searched(here, known)
        return self._look_around(here, known)

    def _put_away(self, cells: dict[str, Cell]) -> str:
        """Put down what was picked by mistake, on anything that is in view, unless that has just failed."""
        place = None if self._tried == "place" else putting_away(cells, self._catalog)
        self._away = place is not None
        return place or _SIDES[0]

    def _not_searched(self, here: str | None, known: list[str]) -> list[str]:
        """Return the rooms of the board in which it has not yet looked all around."""
        if here is not None and self._tried in _SIDES and not set(_SIDES) & set(self._looks):
            self._searched.add(here)
        return [room for room in known if room not in self._searched]

    def _look_around(self, here: str | None, known: list[str]) -> str:
        """Go to a room that the board names, else to the next one, and look around there."""
        if known and here not in known:
            return f"goto_{known[0]}"
        if not self._looks:
            if not known:
                return self._next_room(here)
            self._looks = ["move_forward"] * _PACES + self._round()
        return self._looks[-1]

    def _next_room(self, here: str | None) -> str:
        if here is not None:
            self._searched.add(here)
        left = [room for room in self._order if room not in self._searched]
        if not left:
            self._searched = set() if here is None else {here}
            left = [room for room in self._order if room not in self._searched] or list(self._order)
        return f"goto_{left[-1]}"

    def _round(self) -> list[str]:
        """Return a look around: all turns to one side, drawn at random."""
        return [str(self._rng.choice(_SIDES))] * _TURNS


class ScoutSearch:
    """Sweeps the rooms with a robot that does not grasp until X and Y have been seen, then waits where X was.

    One that flies sweeps a room by ``SWEEP``, one that drives by turning round.
    """

    def __init__(
        self,
        actions: tuple[str, ...],
        rooms: tuple[str, ...],
        order: tuple[str, ...] | None = None,
        known: Catalog = BENCHMARK,
    ):
        """Remember the names of actions and rooms, in the order of their numbers, and the order in which to search."""
        self.actions, self.rooms, self._order, self._catalog = actions, rooms, order or rooms, known
        self._round = sweep_of(actions)
        self.reset(None)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self._moves: list[str] = []
        self._left = list(self._order)
        self._seen: set[str] = set()

    def propose(self, observation: dict[str, np.ndarray], info: dict[str, Any]) -> int:
        """Return the number of the action that is to be taken now; nothing counts as done before it is noted."""
        pairs = read_pairs(observation["instruction"], self._catalog)
        wanted = {name for pair in pairs for name in pair}
        self._seen |= classes_in_view(observation, info, self._catalog)
        if len(pairs) == 1:  # else the board does not say which object has been seen
            board = messages_read(observation, self.rooms, self._catalog)
            self._seen |= {name for name, bits in zip(pairs[0], board, strict=True) if bits.any()}
        return self.actions.index("stay" if self._seen.issuperset(wanted) else self._sweep())

    def note(self, action: int) -> None:
        """Go on from the action that was taken, whatever was proposed."""
        done = self.actions[action]
        if done.startswith("goto_"):
            self._moves = list(self._round[::-1])
            self._left = [room for room in self._left if f"goto_{room}" != done]
        elif self._moves[-1:] == [done]:
            self._moves.pop()

    def _sweep(self) -> str:
        if not self._moves:
            self._left = self._left or list(self._order)
            return f"goto_{self._left[0]}"
        return self._moves[-1]


class SearchPolicy(Team):
    """The searches of all robots together."""

    def __init__(self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], known: Catalog = BENCHMARK):
        """Remember the names of each robot's actions and of the rooms, in the order of their numbers.

        Args:
            actions: robot -> names of its actions.
            rooms: names of the rooms.
            known: the classes that instructions name.
        """
        searches: dict[str, RobotExpert] = {}
        for kind, able in ((GrasperSearch, True), (ScoutSearch, False)):
            robots = [name for name, names in actions.items() if grasps(names) == able]
            for number, name in enumerate(robots):
                first = number * len(rooms) // len(robots)
                searches[name] = kind(actions[name], rooms, rooms[first:] + rooms[:first], known)
        super().__init__(searches)
