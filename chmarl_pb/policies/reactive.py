"""The reactive policy: a humanoid without memory beside the drone of the search policy."""

import numpy as np

from chmarl_pb.policies.narrow_views import FullView, Narrowed, full_view
from chmarl_pb.policies.policy import Actions, Infos, Observations
from chmarl_pb.policies.search import DroneSearch

_TRY = 0.85  # how often it picks or places what it sees; else it moves on, lest it fails for ever
_MOVES = ("turn_left", "move_forward", "goto")
_CHANCES = (0.8, 0.1, 0.1)


class ReactiveHumanoid:
    """Picks or places what is in view, else goes to a room that messages name, else looks around."""

    def __init__(self, rooms: tuple[str, ...]):
        """Remember the rooms."""
        self.rooms = rooms

    def reset(self, rng: np.random.Generator) -> None:
        """Start the random stream anew."""
        self._rng = rng

    def choose(self, view: FullView) -> str:
        """Return the name of the next action."""
        if view.wanted in view.classes and self._rng.random() < _TRY:
            return "place" if view.holding else "pick"
        known = view.messages[view.holding]
        if known and view.room not in known:
            return f"goto_{self._rng.choice(known)}"
        move = str(self._rng.choice(_MOVES, p=_CHANCES))
        return f"goto_{self._rng.choice(known or self.rooms)}" if move == "goto" else move


class ReactivePolicy:
    """The humanoid by what it is shown now, the drone by the search policy, which has a memory."""

    def __init__(self, actions: dict[str, tuple[str, ...]], rooms: tuple[str, ...]):
        """Remember the names of each robot's actions and of the rooms."""
        self._humanoid = Narrowed(actions, rooms, full_view, {"humanoid": ReactiveHumanoid(rooms)})
        self._drone = DroneSearch(actions["drone"], rooms)

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self._humanoid.reset(seed)
        self._drone.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action."""
        drone = self._drone.act(observations["drone"], infos["drone"])
        return {**self._humanoid.act(observations, infos), "drone": drone}
