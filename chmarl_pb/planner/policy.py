"""What drives the robots: a Policy sees observations and infos and answers with actions."""

from typing import Any, Protocol

import numpy as np

Observations = dict[str, dict[str, np.ndarray]]
Infos = dict[str, dict[str, Any]]
Actions = dict[str, int]


class Policy(Protocol):
    """Anything that drives the robots through an episode: random, planned, searched, learned, a person."""

    def reset(self, seed: int | None) -> None:
        """Forget the last episode; called after the environment's reset."""

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action."""


class RandomPolicy:
    """Chooses uniformly among all actions."""

    def __init__(self, counts: dict[str, int]):
        """Remember how many actions each robot has."""
        self.counts = counts
        self._rng = np.random.default_rng()

    def reset(self, seed: int | None) -> None:
        """Start the random stream anew."""
        self._rng = np.random.default_rng(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return a random action of each robot."""
        return {robot: int(self._rng.integers(count)) for robot, count in self.counts.items()}
