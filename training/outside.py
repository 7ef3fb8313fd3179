"""Cooperative games from elsewhere, as ParallelEnvs with the rewards that published results are given in.

They need packages of their own: ``pip install mpe2 lbforaging``.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

from chmarl_pb.errors import MissingExtraError

LBF = "Foraging-8x8-2p-2f-coop-v3"


@contextmanager
def _installed() -> Iterator[None]:
    """Import a game within.

    Raises:
        MissingExtraError: it is not installed.
    """
    try:
        yield
    except ImportError as error:
        raise MissingExtraError(f"this game is not installed ({error}); run `pip install mpe2 lbforaging`") from error


class Spread(ParallelEnv):  # type: ignore[misc]
    """mpe2's simple_spread: three agents are to cover three landmarks, 25 steps long; nothing ends it earlier.

    Each agent's reward is that of the particle environments that Papoudakis et al. 2021 use: minus the distances of all
    landmarks to their nearest agents, minus 1 for each agent that it collides with, itself included. mpe2 gives half
    of it, and does not count itself. The team's return is their sum over steps and agents.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "spread_v0", "render_modes": [], "is_parallelizable": True}

    def __init__(self) -> None:
        with _installed():
            from mpe2 import simple_spread_v3

        # without the wrappers of parallel_env, which check actions and take a third of the time of a step
        self._env: Any = simple_spread_v3.raw_env(N=3, local_ratio=0.5, max_cycles=25)
        self.possible_agents: list[str] = list(self._env.possible_agents)
        self.agents: list[str] = []

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's observation space."""
        found: spaces.Space[Any] = self._env.observation_space(agent)
        return found

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's action space."""
        found: spaces.Space[Any] = self._env.action_space(agent)
        return found

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Draw new places."""
        self._env.reset(seed=seed, options=options)
        self.agents = list(self.possible_agents)
        return self._seen(), {name: {} for name in self.agents}

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        """Let all agents act; each is paid what all get together, as the papers' learners are."""
        names = self.possible_agents
        for name in names:  # they move when the last one has said what it does
            self._env.step(int(actions[name]))
        total = float(sum(2 * self._env.rewards[name] - 1 for name in names))
        ended, cut = dict(self._env.terminations), dict(self._env.truncations)
        self.agents = [] if any(cut.values()) else list(names)
        return self._seen(), dict.fromkeys(names, total), ended, cut, {name: {} for name in names}

    def _seen(self) -> dict[str, np.ndarray]:
        return {name: self._env.observe(name) for name in self.possible_agents}

    def close(self) -> None:
        """Close the window, if any."""
        self._env.close()


class Foraging(ParallelEnv):  # type: ignore[misc]
    """Level-based foraging, 8 x 8 cells, two agents that have to load each of two foods together; at most 50 steps.

    The best return is 1, what all foods are worth.
    """

    metadata: ClassVar[dict[str, Any]] = {"name": "foraging_v0", "render_modes": [], "is_parallelizable": True}

    def __init__(self) -> None:
        import gymnasium

        with _installed():
            import lbforaging  # noqa: F401  # registers its games

        self._env: Any = gymnasium.make(LBF, disable_env_checker=True)
        players: Any = self._env.action_space
        self.possible_agents = [f"agent_{number}" for number in range(len(players))]
        self.agents: list[str] = []

    def observation_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's observation space."""
        return self._part(self._env.observation_space, agent)

    def action_space(self, agent: str) -> spaces.Space[Any]:
        """Return an agent's action space."""
        return self._part(self._env.action_space, agent)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Any, Any]:
        """Draw a new field."""
        seen, _ = self._env.reset(seed=seed)
        self.agents = list(self.possible_agents)
        return self._named(seen), {name: {} for name in self.agents}

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        """Let all agents act; each is paid what all get together."""
        names = self.possible_agents
        seen, rewards, ended, cut, _ = self._env.step(tuple(int(actions[name]) for name in names))
        self.agents = [] if ended or cut else list(names)
        total = float(np.sum(rewards))
        return (
            self._named(seen), dict.fromkeys(names, total), dict.fromkeys(names, bool(ended)),
            dict.fromkeys(names, bool(cut)), {name: {} for name in names},
        )  # fmt: skip

    def close(self) -> None:
        """Close the window, if any."""
        self._env.close()

    def _named(self, seen: Any) -> dict[str, np.ndarray]:
        return dict(zip(self.possible_agents, seen, strict=True))

    def _part(self, space: spaces.Space[Any], agent: str) -> spaces.Space[Any]:
        assert isinstance(space, spaces.Tuple)
        return space[self.possible_agents.index(agent)]
