"""Small games whose answer is known, as PettingZoo ParallelEnvs: matrix games and the two-step game of QMIX."""

from typing import Any, ClassVar

import numpy as np
from gymnasium import spaces
from pettingzoo import ParallelEnv

Observations = dict[str, np.ndarray]

#: Name -> payoff of the actions of agent 1 (rows) and agent 2 (columns).
MATRIX_GAMES: dict[str, np.ndarray] = {
    # Son et al. 2019 (QTRAN), table 1: the best action of one depends on the other's, so no monotonic mixer holds it.
    "non-monotonic": np.array([[8.0, -12.0, -12.0], [-12.0, 0.0, 0.0], [-12.0, 0.0, 0.0]]),
    # The same without the penalty: an AND. It is monotonic and supermodular, so QMIX can hold it, but not additive.
    "monotonic": np.array([[8.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]),
    # An OR: monotonic, but one agent's B makes the other's worth less, which no mixer with one convex layer holds.
    "or": np.array([[0.0, 8.0], [8.0, 8.0]]),
    # Sums of what each agent brings: all four can hold it.
    "additive": np.array([[6.0, 5.0, 2.0], [4.0, 3.0, 0.0], [2.0, 1.0, -2.0]]),
}

#: Payoffs after agent 1's first action in the two-step game (Rashid et al. 2018, section 5).
TWO_STEP = np.array([[[7.0, 7.0], [7.0, 7.0]], [[0.0, 1.0], [1.0, 8.0]]])


class SmallGame(ParallelEnv):  # type: ignore[misc]
    """Two agents that both see which state the game is in, as one-hot."""

    metadata: ClassVar[dict[str, Any]] = {"name": "small_game_v0", "render_modes": [], "is_parallelizable": True}
    states: int
    actions: int

    def __init__(self) -> None:
        self.possible_agents = ["first", "second"]
        self.agents: list[str] = []
        self._at = 0

    def observation_space(self, agent: str) -> spaces.Box:
        """Return an agent's observation space."""
        return spaces.Box(0, 1, (self.states,), np.float32)

    def action_space(self, agent: str) -> spaces.Discrete:
        """Return an agent's action space."""
        return spaces.Discrete(self.actions)

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Observations, Any]:
        """Start an episode in state 0; nothing is drawn."""
        self.agents, self._at = list(self.possible_agents), 0
        return self._observe(), {name: {} for name in self.agents}

    def step(self, actions: dict[str, int]) -> tuple[Any, ...]:
        """Let both agents act."""
        names = self.possible_agents
        reward, terminated = self.play(int(actions[names[0]]), int(actions[names[1]]))
        self.agents = [] if terminated else list(names)
        return (
            self._observe(), dict.fromkeys(names, reward), dict.fromkeys(names, terminated),
            dict.fromkeys(names, False), {name: {} for name in names},
        )  # fmt: skip

    def state(self) -> np.ndarray:
        """Return the state as one-hot."""
        one_hot: np.ndarray = np.eye(self.states, dtype=np.float32)[self._at]
        return one_hot

    def play(self, first: int, second: int) -> tuple[float, bool]:
        """Return the reward of both, and whether the game is over."""
        raise NotImplementedError

    def _observe(self) -> Observations:
        return {name: self.state() for name in self.possible_agents}


class MatrixGame(SmallGame):
    """One step: the payoff of both actions."""

    def __init__(self, payoff: np.ndarray):
        """Play for a square table of payoffs."""
        super().__init__()
        self.payoff, self.states, self.actions = payoff, 1, len(payoff)

    def play(self, first: int, second: int) -> tuple[float, bool]:
        """Pay, and end."""
        return float(self.payoff[first, second]), True


class TwoStepGame(SmallGame):
    """Rashid et al. 2018, section 5: agent 1's first action chooses which of two matrix games is played next."""

    states, actions = 3, 2

    def play(self, first: int, second: int) -> tuple[float, bool]:
        """Go to the chosen game, or pay and end."""
        if self._at == 0:
            self._at = 1 + first
            return 0.0, False
        return float(TWO_STEP[self._at - 1, first, second]), True
