"""A mixer of your own: a weighted sum of the agents' values, with positive weights that depend on the state.

python examples/new_mixer.py
chmarl-pb train --algo qmix --mixer examples.new_mixer:WeightedSum
"""

from chmarl_pb.extras import needs

with needs("this example", "train", script=True):
    from torch import Tensor, nn

from chmarl_pb.learning import Config, train
from chmarl_pb.learning.algorithms.mixers import MIXERS, Mixer
from training.games import TwoStepGame


class WeightedSum(Mixer):
    """Q_tot = sum_i w_i(s) Q_i + b(s), with w_i > 0, so that each agent's best action is best for the team."""

    def __init__(self, agents: int, state_size: int, units: int = 32):
        """Make the layers that turn the state into the weights and the bias."""
        super().__init__()
        self.weights = nn.Sequential(nn.Linear(state_size, agents), nn.Softplus())
        self.bias = nn.Linear(state_size, 1)

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the team's value (B, T, 1) from the agents' (B, T, N) and the state (B, T, S)."""
        q_total: Tensor = (values * self.weights(state)).sum(dim=-1, keepdim=True) + self.bias(state)
        return q_total


def main(episodes: int = 1_000) -> None:
    """Train on the two-step game of the QMIX paper."""
    MIXERS["weighted-sum"] = WeightedSum
    config = Config(episodes=episodes, horizon=2, mixer="weighted-sum", learning_rate=5e-3, features=16, hidden=16)
    result = train(TwoStepGame, "qmix", config)
    print(f"return of the greedy actions: {result.best_score:g} of 8")


if __name__ == "__main__":
    main()
