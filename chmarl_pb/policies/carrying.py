"""A robot that points, sees, and is not told what to bring where: it carries what it sees to what it sees.

Each thing that it puts down somewhere is one try of a pair of X and Y. So it takes the tries that come soonest: it
picks what is in view, puts it on another receptacle that is in view, and goes on from there. Classes that it has seen
in several colours come first: among lookalikes X's is one of them.
"""

from collections.abc import Iterator

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.aiming import aimed
from chmarl_pb.policies.narrow_views import SeeingView
from chmarl_pb.robots.pointing import VERBS

_LOOKS = 4  # turns of 30 degrees until another room is more promising


class Carrier:
    """Picks what it sees and puts it where it has not yet put such a thing; rooms on the board come first."""

    def __init__(self, rooms: tuple[str, ...], known: Catalog):
        """Remember the rooms, and the classes that X and Y can be of."""
        self.rooms = rooms
        self._kinds = frozenset(known.graspables), frozenset(known.receptacles)

    def reset(self, rng: np.random.Generator) -> None:
        """Forget the last episode."""
        self._rng, self._order = rng, [self.rooms[number] for number in rng.permutation(len(self.rooms))]
        self._tried: set[tuple[str, str]] = set()  # classes that were X and Y in a try, or cannot be
        self._last, self._aim, self._item = "", "", ""  # action, class that it pointed at, class in the hand
        self._holding, self._turns = False, 0
        self._vain: set[str] = set()  # classes at which it has pointed in vain from here
        self._colors: dict[str, frozenset[int]] = {}  # in which each class has been seen
        self._side = str(rng.choice(["turn_left", "turn_right"]))

    def choose(self, view: SeeingView) -> str:
        """Return the name of the next action."""
        self._learn(view)
        wanted = view.messages[int(view.holding)]
        if wanted and view.room not in wanted:
            return self._move(f"goto_{wanted[0]}")
        aim = next(self._aims(view), None)
        if aim is None:
            return self._look_on(wanted)
        self._aim = aim
        self._last = VERBS[view.holding]
        return aimed(self._last, view.cells.get(aim))

    def _learn(self, view: SeeingView) -> None:
        """Note what has become of the last action."""
        done = view.holding != self._holding
        self._holding = view.holding
        if self._last in VERBS and not done:
            self._vain.add(self._aim)
        elif self._last in VERBS:
            self._vain, self._turns = set(), 0
            if view.holding:
                self._item = self._aim
            else:
                self._tried.add((self._item, self._aim))
        for name, colors in view.colors.items():
            self._colors[name] = self._colors.get(name, frozenset()) | colors
        for item, support in view.supports.items():
            self._tried.add((item, support))

    def _aims(self, view: SeeingView) -> Iterator[str]:
        """Yield the classes in view that are worth a try, the best first."""
        twins = frozenset(name for name, colors in self._colors.items() if len(colors) > 1)
        kinds = twins if twins and not view.holding else self._kinds[view.holding]
        for name in view.cells or sorted(view.classes):
            if name in kinds and name not in self._vain:
                if not view.holding or (self._item, name) not in self._tried:
                    yield name

    def _look_on(self, wanted: tuple[str, ...]) -> str:
        """Turn a little; then go to another room."""
        self._turns += 1
        if self._turns <= _LOOKS:
            return self._move(self._side)
        self._order.append(self._order.pop(0))
        return self._move(f"goto_{(wanted or self._order)[0]}")

    def _move(self, action: str) -> str:
        self._vain, self._last = set(), action
        if action.startswith("goto_"):
            self._turns = 0
        return action
