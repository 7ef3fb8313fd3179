"""How a robot that grasps follows one that points: it turns there, goes on, and steps aside where it is stuck."""

import numpy as np

from chmarl_pb.policies.belief.looks import GOTO

_STRAIGHT = np.pi / 11  # radians off within which it goes on rather than turns
_SIDESTEPS = 2  # in one room, until it searches by itself again
_SIDES = ("turn_left", "turn_right")


class Follower:
    """Follows what is pointed out in one episode; nothing counts as done before it is noted."""

    def __init__(self) -> None:
        """Begin an episode."""
        self._way: list[str] = []  # from the proposed action on, backwards
        self._rest: list[str] = []  # what is left of a sidestep, backwards
        self._sidesteps = 0

    def begin(self) -> None:
        """Begin to choose an action, which need not be one of these."""
        self._way = []

    def towards(self, away: float, stuck: bool) -> str | None:
        """Return a turn or a pace.

        Args:
            away: radians to the left of where it looks.
            stuck: whether the last pace has led nowhere.

        Returns:
            The action's name; None if it has stepped aside often enough.
        """
        if self._rest:
            self._way = self._rest
        elif stuck and self._sidesteps == _SIDESTEPS:
            return None
        elif abs(away) > _STRAIGHT:
            self._way = [_SIDES[away < 0]]
        elif stuck:
            self._way = ["move_forward", *[_SIDES[self._sidesteps % 2]] * 3]
        else:
            self._way = ["move_forward"]
        return self._way[-1]

    def note(self, action: str, followed: bool) -> None:
        """Go on from what was done; ``followed``: whether that was proposed."""
        way = self._way if followed else []
        self._sidesteps += len(way) > 1 and not self._rest
        self._rest = way[:-1]
        if action.startswith(GOTO):
            self._sidesteps = 0
