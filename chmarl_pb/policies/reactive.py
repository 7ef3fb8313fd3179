"""The reactive policy: robots that grasp have no memory; the others search as in the search policy."""

from functools import partial

import numpy as np

from chmarl_pb.catalog import Catalog
from chmarl_pb.policies.aiming import aimed
from chmarl_pb.policies.expert import Team
from chmarl_pb.policies.narrow_views import Chooser, FullView, Narrowed, full_view
from chmarl_pb.policies.policy import Actions, Infos, Observations, grasps
from chmarl_pb.policies.search import SearchPolicy
from chmarl_pb.robots.pointing import VERBS

_TRY = 0.85  # how often it picks or places what it sees; else it moves on, lest it fails for ever
_MOVES = ("turn_left", "move_forward", "goto")
_CHANCES = (0.8, 0.1, 0.1)


class ReactiveGrasper:
    """Picks or places what is in view, else goes to a room that messages name, else looks around."""

    def __init__(self, rooms: tuple[str, ...]):
        """Remember the rooms."""
        self.rooms = rooms

    def reset(self, rng: np.random.Generator) -> None:
        """Start the random stream anew."""
        self._rng = rng

    def choose(self, view: FullView) -> str:
        """Return the name of the next action."""
        if view.wanted & view.classes and self._rng.random() < _TRY:
            cells = [cell for name, cell in view.cells.items() if name in view.wanted]
            return aimed(VERBS[view.holding], next(iter(cells), None))
        known = view.messages[view.holding]
        if known and view.room not in known:
            return f"goto_{self._rng.choice(known)}"
        move = str(self._rng.choice(_MOVES, p=_CHANCES))
        return f"goto_{self._rng.choice(known or self.rooms)}" if move == "goto" else move


class ReactivePolicy:
    """Robots that grasp by what they are shown now, the others by the search policy, which has a memory."""

    def __init__(self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...], known: Catalog):
        """Remember the names of each robot's actions and of the rooms, and the classes that there are."""
        choosers: dict[str, Chooser[FullView]] = {
            name: ReactiveGrasper(rooms) for name, names in actions.items() if grasps(names)
        }  # fmt: skip
        self._reactive = Narrowed(actions, rooms, partial(full_view, known=known), choosers)
        searches = SearchPolicy(actions, rooms, known).parts
        self._others = Team({name: search for name, search in searches.items() if name not in choosers})

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self._reactive.reset(seed)
        self._others.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action."""
        theirs = {name: seen for name, seen in observations.items() if name in self._others.parts}
        return {**self._reactive.act(observations, infos), **self._others.act(theirs, infos)}
