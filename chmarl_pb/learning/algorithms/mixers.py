"""How the agents' values become a team's value: a mixer is one class, and one row of ``MIXERS``.

A mixer is called as ``mixer(values (B, T, N), state (B, T, S))``. IQL's gives a value for each agent, (B, T, N), those
of VDN and QMIX give one for the team, (B, T, 1); all three are learned by one loss, ``td_loss``. QTRAN does not mix,
see :mod:`chmarl_pb.learning.algorithms.qtran`.
"""

from typing import Any

import torch
from torch import Tensor, nn


class Mixer(nn.Module):
    """Makes a team's value of the agents'.

    >>> class Mean(Mixer):
    ...     def forward(self, values, state):
    ...         return values.mean(dim=-1, keepdim=True)
    >>> MIXERS["mean"] = Mean  # now --mixer mean; or, without this line, --mixer my_module:Mean
    >>> Mean(agents=2)(torch.tensor([[[1.0, 3.0]]]), torch.zeros(1, 1, 5))
    tensor([[[2.]]])
    >>> del MIXERS["mean"]

    Attributes:
        per_agent: whether it gives a value for each agent, who then learns from its own reward.
    """

    per_agent = False

    def __init__(self, agents: int = 0, state_size: int = 0, units: int = 32):
        """Make the layers.

        Args:
            agents: their number N.
            state_size: numbers S in the global state.
            units: of a hidden layer.
        """
        super().__init__()


def mixed(mixer: Mixer, values: Tensor, states: Tensor) -> Tensor:
    """Return what a mixer makes of values (B, T, N) and states (B, T, S).

    Raises:
        ValueError: that has another shape than it should.
    """
    found: Any = mixer(values, states)
    wanted = (*values.shape[:2], values.shape[2] if mixer.per_agent else 1)
    if not isinstance(found, Tensor) or found.shape != wanted:
        given = tuple(found.shape) if isinstance(found, Tensor) else repr(found)
        raise ValueError(
            f"the mixer {type(mixer).__name__} gives {given} for values {tuple(values.shape)}; it is to give {wanted}"
        )
    return found


class Independent(Mixer):
    """IQL (Tan 1993; Tampuu et al. 2017): each agent learns by itself, the others are part of its surroundings."""

    per_agent = True

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the agents' values (B, T, N) as they are."""
        return values


class Sum(Mixer):
    """VDN (Sunehag et al. 2018, https://arxiv.org/abs/1706.05296): Q_tot = sum_i Q_i."""

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the team's value (B, T, 1) from the agents' (B, T, N)."""
        return values.sum(dim=-1, keepdim=True)


class QMixer(Mixer):
    """QMIX (Rashid et al. 2018, https://arxiv.org/abs/1803.11485): Q_tot is a function with dQ_tot / dQ_i >= 0.

    **Class**: some monotonic functions, the supermodular ones.

    So the joint argmax is that of each agent by itself. A mixing network of two layers,

        Q_tot = |W2(s)|^T elu(|W1(s)|^T Q + b1(s)) + b2(s),

    has weights and biases that hypernetworks make of the state s: all are linear but b2, which has a hidden layer.

    Not every monotonic function is within reach: ELU is convex, so Q_tot is a sum of convex functions of weighted sums,
    and its mixed second differences are at least 0 (it is supermodular): a high value of one agent never makes that of
    another count for less. An AND of two agents is held, an OR is not, see :func:`training.theory.supermodular_fit`.
    """

    def __init__(self, agents: int, state_size: int, units: int = 32):
        """Make the hypernetworks."""
        super().__init__()
        self.agents, self.units = agents, units
        self.first_weight = nn.Linear(state_size, agents * units)
        self.first_bias = nn.Linear(state_size, units)
        self.second_weight = nn.Linear(state_size, units)
        self.second_bias = nn.Sequential(nn.Linear(state_size, units), nn.ReLU(), nn.Linear(units, 1))

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the team's value (B, T, 1) from the agents' (B, T, N) and the state (B, T, S)."""
        weight = self.first_weight(state).abs().unflatten(-1, (self.agents, self.units))
        mixed = torch.einsum("...n,...ne->...e", values, weight)
        hidden = nn.functional.elu(mixed + self.first_bias(state))
        total = (hidden * self.second_weight(state).abs()).sum(dim=-1, keepdim=True)
        q_total: Tensor = total + self.second_bias(state)
        return q_total


class DeepQMixer(Mixer):
    """A monotonic mixing network of two hidden layers, half of whose units are convex and half concave.

    **Class**: all continuous monotonic functions of two agents' values, as units grow; of more agents at least sums of
    such functions of weighted sums, an AND and an OR of all of them included (Runje and Shankaranarayana 2023,
    https://arxiv.org/abs/2205.11775, prove universality with as many layers as there are inputs). A value that is not
    monotonic in each agent's remains beyond it, as beyond any mixer by which agents find the joint argmax alone.

    More layers of a convex ELU alone would be no gain: a convex rising function of supermodular ones is supermodular.
    Not of the paper: a unit is elu(x) or -elu(-x), and Q_tot = |W3|^T g(|W2|^T g(|W1|^T Q + b1) + b2) + b3, where all
    weights and biases come from hypernetworks of the state, as in QMIX, those of W2 divided by the units.
    """

    def __init__(self, agents: int, state_size: int, units: int = 32):
        """Make the hypernetworks.

        Raises:
            ValueError: there is but one unit, which cannot be both convex and concave.
        """
        super().__init__()
        if units < 2:
            raise ValueError(f"embedding={units}: qmix-deep needs at least 2, as half of its units are concave")
        self.agents, self.units = agents, units
        sizes = (agents * units, units * units, units)
        self.weights = nn.ModuleList(nn.Linear(state_size, size) for size in sizes)
        self.biases = nn.ModuleList(nn.Linear(state_size, units) for _ in range(2))
        self.last_bias = nn.Sequential(nn.Linear(state_size, units), nn.ReLU(), nn.Linear(units, 1))

    def forward(self, values: Tensor, state: Tensor) -> Tensor:
        """Return the team's value (B, T, 1) from the agents' (B, T, N) and the state (B, T, S)."""
        shapes = ((self.agents, self.units), (self.units, self.units), (self.units, 1))
        first, second, third = (
            make(state).abs().unflatten(-1, shape) for make, shape in zip(self.weights, shapes, strict=True)
        )
        hidden = _bent(torch.einsum("...n,...ne->...e", values, first) + self.biases[0](state))
        hidden = _bent(torch.einsum("...n,...ne->...e", hidden, second / self.units) + self.biases[1](state))
        q_total: Tensor = torch.einsum("...n,...ne->...e", hidden, third) + self.last_bias(state)
        return q_total


def _bent(numbers: Tensor) -> Tensor:
    """Return numbers (..., E) bent upwards in the first half of the units, and downwards in the second."""
    convex, concave = numbers.chunk(2, dim=-1)
    return torch.cat([nn.functional.elu(convex), -nn.functional.elu(-concave)], dim=-1)


#: Algorithms that are nothing but their mixer.
BY_MIXER = ("iql", "vdn")

#: Name, that of the algorithm whose default it is -> mixer.
MIXERS: dict[str, type[Mixer]] = {"iql": Independent, "vdn": Sum, "qmix": QMixer, "qmix-deep": DeepQMixer}
