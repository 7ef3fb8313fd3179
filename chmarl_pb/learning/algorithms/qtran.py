"""QTRAN-base (Son et al. 2019, https://arxiv.org/abs/1905.05408): a free joint value, and agents that agree with it.

QTRAN does not mix: it learns the team's value freely and then makes the sum of the agents' values agree with it where
it matters.
"""

import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.losses import (
    Returns,
    Unrolled,
    before,
    chosen,
    greedy_actions,
    lambda_returns,
    mean,
    mean_square,
)
from chmarl_pb.learning.algorithms.value import ValueLearner
from chmarl_pb.learning.components import of_each
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.spaces import LearnerInterface


class QtranNetworks(nn.Module):
    """A free joint value Q_jt and a state value V_jt.

    Both see the sum over the agents of what a layer makes of an agent's history (and action), and the state. The
    histories are the outputs of the agents' own GRUs: lower layers are shared. Q'_jt is the sum of the agents' values.

    Attributes:
        per_agent: as of a mixer: the values are the team's.
    """

    per_agent = False

    def __init__(self, interface: LearnerInterface, hidden: int, units: int):
        """Make the layers for the agents of an environment, with histories of size ``hidden``."""
        super().__init__()
        sizes = [of_each(counts) for counts in interface.actions.values()]
        counts = [len(own) * max(own) for own in sizes]  # of one-hots, all components padded to the largest
        self.acted = nn.ModuleList(nn.Linear(hidden + count, units) for count in counts)
        self.lived = nn.ModuleList(nn.Linear(hidden, units) for _ in counts)
        self.joint = _three_layers(units + interface.state_size, units)
        self.value = _three_layers(units + interface.state_size, units)

    def q_joint(self, histories: list[Tensor], actions: list[Tensor], state: Tensor) -> Tensor:
        """Return Q_jt(tau, u) (B, T, 1) from each agent's history (B, T, H) and action as one-hot (B, T, K * A)."""
        pairs = zip(self.acted, histories, actions, strict=True)
        parts = [torch.relu(layer(torch.cat([history, action], dim=-1))) for layer, history, action in pairs]
        q_joint: Tensor = self.joint(torch.cat([torch.stack(parts).sum(dim=0), state], dim=-1))
        return q_joint

    def v_joint(self, histories: list[Tensor], state: Tensor) -> Tensor:
        """Return V_jt(tau) (B, T, 1) from each agent's history (B, T, H)."""
        parts = [torch.relu(layer(history)) for layer, history in zip(self.lived, histories, strict=True)]
        v_joint: Tensor = self.value(torch.cat([torch.stack(parts).sum(dim=0), state], dim=-1))
        return v_joint


class Qtran(ValueLearner):
    """Value factorisation with the networks and the loss of QTRAN in the place of a mixer.

    Unlike Son et al., agents share no weights and are recurrent, the three losses have equal weights, and targets are
    of double Q: the next actions are those that the networks in training think best.
    """

    def make_mixer(self, interface: LearnerInterface) -> nn.Module:
        """Return the joint networks.

        Raises:
            ValueError: the settings name a mixer.
        """
        if self.config.mixer:
            raise ValueError(f"mixer={self.config.mixer!r}: qtran learns a joint value in its place; use qmix or vdn")
        return QtranNetworks(interface, self.config.hidden, self.config.joint_units)

    def td_loss(
        self, online: Unrolled, target: Unrolled, mixer: nn.Module, target_mixer: nn.Module, batch: Batch
    ) -> dict[str, Tensor]:
        """Return the three losses of QTRAN, see :func:`qtran_loss`."""
        return qtran_loss(online, target, mixer, target_mixer, batch, self.returns)  # type: ignore[arg-type]


def qtran_loss(
    online: Unrolled,
    target: Unrolled,
    networks: QtranNetworks,
    target_networks: QtranNetworks,
    batch: Batch,
    returns: Returns,
) -> dict[str, Tensor]:
    """Return the loss of QTRAN-base (Son et al. 2019, section 3): L_td + L_opt + L_nopt.

    With Q' = sum_i Q_i, u the joint action that was taken and u* that of the agents' own argmax, theorem 1 asks that

        Q'(tau, u) - Q_jt(tau, u) + V_jt(tau)  is 0 for u = u* (4a), and >= 0 for every other u (4b).

    Then u* is also the argmax of Q_jt, whatever Q_jt is. QMIX restricts Q_jt to functions that rise with the Q_i; QTRAN
    does not, and asks for agreement by losses instead:

        L_td   = (Q_jt(tau, u) - y)^2,  y = r + gamma Q_jt^-(tau', u'*)
        L_opt  = (Q'(tau, u*) - Q_jt(tau, u*) + V_jt(tau))^2               with Q_jt held fixed
        L_nopt = min(Q'(tau, u) - Q_jt(tau, u) + V_jt(tau), 0)^2           with Q_jt held fixed

    With a lambda, y looks further ahead. An agent that does not act has no action (zeros instead of a one-hot) in
    Q_jt, and none of its values in Q'.
    """
    reward, not_done, mask = batch.team()
    best = greedy_actions(online.values, batch)
    best_now = {name: action[:, :-1] for name, action in best.items()}
    best_next = {name: action[:, 1:] for name, action in best.items()}
    hidden, state = _listed(online.hidden_states, slice(None, -1)), batch.states[:, :-1]

    q_joint = networks.q_joint(hidden, _one_hot(online, batch.actions, batch.acted), state)
    with torch.no_grad():
        after = _listed(target.hidden_states, slice(1, None))
        q_next = target_networks.q_joint(after, _one_hot(online, best_next, batch.next_mask), batch.states[:, 1:])
        returns.update_scale(reward, not_done, mask)
        y = returns.normalize(
            lambda_returns(reward, not_done, returns.denormalize(q_next), mask, returns.gamma, returns.td_lambda)
        )
        q_joint_best = networks.q_joint(hidden, _one_hot(online, best_now, batch.acted), state)
    v_joint = networks.v_joint(hidden, state)

    now = before(online.values)
    sum_best = (chosen(now, best_now) * batch.acted).sum(dim=-1, keepdim=True)
    sum_taken = (chosen(now, batch.actions) * batch.acted).sum(dim=-1, keepdim=True)
    td = mean_square(q_joint - y, mask)
    optimal = mean_square(sum_best - q_joint_best + v_joint, mask)
    other = mean_square((sum_taken - q_joint.detach() + v_joint).clamp(max=0), mask)
    parts = {"td": td.detach(), "opt": optimal.detach(), "nopt": other.detach()}
    return {"loss": td + optimal + other, "q": mean(q_joint.detach(), mask), **parts}


def _listed(histories: dict[str, Tensor], steps: slice) -> list[Tensor]:
    return [history[:, steps] for history in histories.values()]


def _one_hot(unrolled: Unrolled, actions: dict[str, Tensor], acts: Tensor) -> list[Tensor]:
    """Return each agent's actions as one-hot (B, T, K * A); zeros where it does not act, as ``acts`` (B, T, N) says."""
    sizes = [value.shape[-1] for value in unrolled.values.values()]
    rows = zip(actions.values(), sizes, acts.unbind(dim=-1), strict=True)
    return [
        nn.functional.one_hot(action, size).flatten(-2) * acting.unsqueeze(-1).float() for action, size, acting in rows
    ]


def _three_layers(inputs: int, units: int) -> nn.Sequential:
    return nn.Sequential(
        nn.Linear(inputs, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(), nn.Linear(units, 1)
    )  # fmt: skip
