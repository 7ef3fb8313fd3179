"""The blind policy: it sees nothing and reads nothing, and solves most tasks by obeying the message board.

Robots that do not grasp look into all rooms, so that the true messages name those of X and Y. Those that grasp go there
and turn until there is any feedback: that tells them that the thing was in view. Then they pick or place.
"""

from collections.abc import Sequence
from typing import Generic, TypeVar

import numpy as np

from chmarl_pb.policies.groping import Groper
from chmarl_pb.policies.narrow_views import BlindView, Chooser, Narrowed, blind_view
from chmarl_pb.policies.policy import grasps
from chmarl_pb.policies.search import sweep_of
from chmarl_pb.policies.spots import turned_by
from chmarl_pb.robots.pointing import VERBS

_ROUND = 11  # turns of 30 degrees after the first look
_PACES = 3  # forward moves before it looks around again
_STRIDE = 3  # turns between two tries where no feedback tells what is in view: as wide as the picture
_BACK = {"turn_left": "turn_right", "turn_right": "turn_left"}

View = TypeVar("View", bound=BlindView)


class BlindGrasper(Generic[View]):
    """Goes where messages say, and turns until feedback says that it should have picked or placed."""

    def __init__(self, rooms: tuple[str, ...], feedback: bool = True):
        """Remember the rooms, and whether there is feedback at all."""
        self.rooms, self._feedback = rooms, feedback

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""
        self._unvisited = _shuffled(self.rooms, rng)[::-1]  # against the scouts' order
        self._unturned = list(self.rooms)
        self._side = str(rng.choice(list(_BACK)))
        self._last, self._queue = "", list[str]()
        self._anchor, self._turned = "", 0  # room whose anchor it stands on, and turns to the left since
        self._before = self._anchor, self._turned  # the same one action earlier
        self._begin(False)

    def choose(self, view: View) -> str:
        """Return the name of the next action."""
        if view.holding != self._holding:
            self._begin(view.holding)
        self._last = self._next(view)
        self._move(self._last)
        return self._last

    def _begin(self, holding: bool) -> None:
        """Turn to X, or to Y."""
        self._holding = holding
        self._queue, self._anchor, self._turns, self._tried = [], "", 0, False
        self._searched: list[str] = []

    def _move(self, action: str) -> None:
        """Note where an action leads."""
        self._before = self._anchor, self._turned
        if action.startswith("goto_"):
            self._anchor, self._turned = action.removeprefix("goto_"), 0
            self._tried, self._turns = False, 0
            self._unvisited = [room for room in self._unvisited if room != self._anchor]
        elif action in _BACK:
            self._turned += 1 if action == "turn_left" else -1
            self._tried &= self._feedback or self._turned % _STRIDE != 0
        elif action == "move_forward":
            self._anchor = ""
        elif action in VERBS:
            self._tried = True

    def _next(self, view: View) -> str:
        if view.feedback and self._last:
            self._queue = self._heed(view)
        if self._queue:
            return self._queue.pop(0)
        known = view.messages[int(view.holding)]
        return self._look_around(view, known) if known else self._explore(view)

    def _heed(self, view: View) -> list[str]:
        """Return what is to be done when there is feedback."""
        return self._return()

    def _return(self) -> list[str]:
        """Return the actions that pick or place what was in view before the last action."""
        verb = VERBS[self._holding]
        if self._last in _BACK:  # it came into view at the leading edge, and is most likely still there
            return [verb, _BACK[self._last], verb]
        anchor, turned = self._before
        if self._last.startswith("goto_") and anchor:
            return [f"goto_{anchor}", *turned_by(turned), verb]
        return [verb]

    def _look_around(self, view: View, known: Sequence[str]) -> str:
        """Try at once what may be in view, then turn; after a whole round, try another room or another spot."""
        left = [room for room in known if room not in self._searched] or list(known)
        if view.room not in left:
            return f"goto_{left[0]}"
        if self._worth_trying(view):
            return VERBS[self._holding]
        if self._last in VERBS and self._anchor != view.room:
            return f"goto_{view.room}"  # its anchor faces most of what could be meant
        if self._turns < _ROUND:
            self._turns += 1
            return self._side
        self._turns = 0
        others = [room for room in left if room != view.room]
        if others:
            self._searched.append(str(view.room))
            return f"goto_{others[0]}"
        self._queue = ["move_forward"] * (_PACES - 1)
        return "move_forward"

    def _worth_trying(self, view: View) -> bool:
        """Return whether to pick or place although nothing tells that it would work: once wherever it has come to."""
        return not self._tried

    def _explore(self, view: View) -> str:
        """Look into the rooms one by one, then all around in each; without feedback, try what may be in view."""
        if not self._feedback and self._anchor and self._worth_trying(view):
            return VERBS[self._holding]
        if self._unvisited:
            return f"goto_{self._unvisited[0]}"
        if self._anchor in self._unturned:
            self._turns += 1
            if self._turns <= _ROUND:
                return self._side
            self._unturned.remove(self._anchor)
        self._unturned = self._unturned or list(self.rooms)
        return f"goto_{self._unturned[0]}"


class BlindScout:
    """Looks into all rooms, then sweeps them, until messages name a room of X and one of Y."""

    def __init__(self, actions: tuple[str, ...], rooms: tuple[str, ...]):
        """Remember the names of actions and rooms."""
        self.rooms, self._sweep = rooms, sweep_of(actions)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""
        order = _shuffled(self.rooms, rng)
        peeks = [f"goto_{room}" for room in order]
        sweeps = [move for room in (*order[-1:], *order[:-1]) for move in (f"goto_{room}", *self._sweep)]
        self._plan = [*peeks, *sweeps[1:]]  # the first sweep begins where the last peek ended

    def choose(self, view: BlindView) -> str:
        """Return the name of the next action."""
        if all(view.messages) or not self._plan:
            return "stay"
        return self._plan.pop(0)


class BlindPolicy(Narrowed[BlindView]):
    """All robots, by :class:`BlindView` alone."""

    def __init__(self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], feedback: bool = True):
        """Remember the names of each robot's actions and of the rooms, and whether there is feedback."""
        choosers: dict[str, Chooser[BlindView]] = {
            name: _grasper(names, rooms, feedback) if grasps(names) else BlindScout(names, rooms)
            for name, names in actions.items()
        }
        super().__init__(actions, rooms, blind_view, choosers)


def _grasper(actions: Sequence[str], rooms: tuple[str, ...], feedback: bool) -> Chooser[BlindView]:
    """Return what drives a robot that grasps; one that points has to know where, unless feedback tells when."""
    return BlindGrasper(rooms, feedback) if feedback or "pick" in actions else Groper(rooms)


def _shuffled(rooms: Sequence[str], rng: np.random.Generator) -> list[str]:
    return [rooms[number] for number in rng.permutation(len(rooms))]
