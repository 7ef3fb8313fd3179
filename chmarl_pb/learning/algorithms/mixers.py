"""How the agents' values become a team's value: IQL, VDN, QMIX and the networks of QTRAN.

The first three are one call, ``mixer(values (B, T, N), state (B, T, S))``, and one loss, ``td_loss``: IQL gives a
value for each agent, (B, T, N), VDN and QMIX one for the team, (B, T, 1). QTRAN does not mix: it learns the team's
value freely and then makes the sum of the agents' values agree with it where it matters, ``qtran_loss``.
"""

import torch
from torch import Tensor, nn

from chmarl_pb.learning.config import Config
from chmarl_pb.learning.spaces import Interface


class Independent(nn.Module):
    """IQL (Tan 1993; Tampuu et al. 2017): each agent learns by itself, the others are part of its surroundings."""

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the agents' values (B, T, N) as they are."""
        return values


class Sum(nn.Module):
    """VDN (Sunehag et al. 2018, https://arxiv.org/abs/1706.05296): Q_tot = sum_i Q_i."""

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the team's value (B, T, 1) from the agents' (B, T, N)."""
        return values.sum(dim=-1, keepdim=True)


class QMixer(nn.Module):
    """QMIX (Rashid et al. 2018, https://arxiv.org/abs/1803.11485): Q_tot is a function with dQ_tot / dQ_i >= 0.

    So the joint argmax is that of each agent by itself. A mixing network of two layers,

        Q_tot = |W2(s)|^T elu(|W1(s)|^T Q + b1(s)) + b2(s),

    has weights and biases that hypernetworks make of the state s: all are linear but b2, which has a hidden layer.

    Not every monotonic function is within reach: ELU is convex, so Q_tot is a sum of convex functions of weighted sums,
    and its mixed second differences are at least 0 (it is supermodular): a high value of one agent never makes that of
    another count for less. An AND of two agents is held, an OR is not, see :func:`training.theory.supermodular_fit`.
    """

    def __init__(self, agents: int, state_size: int, embedding: int):
        """Make the hypernetworks."""
        super().__init__()
        self.agents, self.embedding = agents, embedding
        self.first_weight = nn.Linear(state_size, agents * embedding)
        self.first_bias = nn.Linear(state_size, embedding)
        self.second_weight = nn.Linear(state_size, embedding)
        self.second_bias = nn.Sequential(nn.Linear(state_size, embedding), nn.ReLU(), nn.Linear(embedding, 1))

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the team's value (B, T, 1) from the agents' (B, T, N) and the state (B, T, S)."""
        weight = self.first_weight(state).abs().unflatten(-1, (self.agents, self.embedding))
        mixed = torch.einsum("...n,...ne->...e", values, weight)
        units = nn.functional.elu(mixed + self.first_bias(state))
        total = (units * self.second_weight(state).abs()).sum(dim=-1, keepdim=True)
        return total + self.second_bias(state)


class QtranNetworks(nn.Module):
    """QTRAN-base (Son et al. 2019, https://arxiv.org/abs/1905.05408): a free joint value Q_jt and a state value V_jt.

    Both see the sum over the agents of what a layer makes of an agent's history (and action), and the state. The
    histories are the outputs of the agents' own GRUs: lower layers are shared. Q'_jt is the sum of the agents' values.
    """

    def __init__(self, interface: Interface, hidden: int, embedding: int):
        """Make the layers for the agents of an environment, with histories of size ``hidden``."""
        super().__init__()
        counts = interface.actions.values()
        self.acted = nn.ModuleList(nn.Linear(hidden + count, embedding) for count in counts)
        self.lived = nn.ModuleList(nn.Linear(hidden, embedding) for _ in counts)
        self.joint = _three_layers(embedding + interface.state_size, embedding)
        self.value = _three_layers(embedding + interface.state_size, embedding)

    def q_joint(self, histories: list[Tensor], actions: list[Tensor], state: Tensor) -> Tensor:
        """Return Q_jt(tau, u) (B, T, 1) from each agent's history (B, T, H) and action as one-hot (B, T, A)."""
        pairs = zip(self.acted, histories, actions, strict=True)
        parts = [torch.relu(layer(torch.cat([history, action], dim=-1))) for layer, history, action in pairs]
        return self.joint(torch.cat([torch.stack(parts).sum(dim=0), state], dim=-1))

    def v_joint(self, histories: list[Tensor], state: Tensor) -> Tensor:
        """Return V_jt(tau) (B, T, 1) from each agent's history (B, T, H)."""
        parts = [torch.relu(layer(history)) for layer, history in zip(self.lived, histories, strict=True)]
        return self.value(torch.cat([torch.stack(parts).sum(dim=0), state], dim=-1))


def make_mixer(algorithm: str, interface: Interface, config: Config) -> nn.Module:
    """Return what joins the agents' values in an algorithm.

    Raises:
        ValueError: there is no such algorithm.
    """
    if algorithm == "iql":
        return Independent()
    if algorithm == "vdn":
        return Sum()
    if algorithm == "qmix":
        return QMixer(len(interface.agents), interface.state_size, config.embedding)
    if algorithm == "qtran":
        return QtranNetworks(interface, config.hidden, config.joint_units)
    raise ValueError(f"algorithm={algorithm!r} is not known; use one of: iql, vdn, qmix, qtran")


def _three_layers(inputs: int, units: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(), nn.Linear(units, 1)
    )  # fmt: skip
