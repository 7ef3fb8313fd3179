"""The losses of IQL, VDN and QMIX (one) and of QTRAN, over whole episodes.

A batch has T steps and T + 1 observations. An agent counts at a step if it acts there; a truncated episode is
bootstrapped from its last observation, a terminated one is not.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.mixers import QtranNetworks
from chmarl_pb.learning.networks.agents import NO_ACTION
from chmarl_pb.learning.spaces import Tree, over


@dataclass(frozen=True)
class Batch:
    """Episodes as tensors, padded to the longest.

    Attributes:
        observations: agent -> (B, T + 1, ...).
        actions: agent -> (B, T) int64.
        legal: agent -> (B, T + 1, A) bool, the actions that it may take.
        states: (B, T + 1, S).
        rewards: (B, T, N).
        acted: (B, T, N) bool, whether the agent took part in the step.
        terminated: (B, T, N) bool, whether the step ended the agent's task.
        labels: agent -> (B, T) int64, what a teacher would have done, or -1.
    """

    observations: dict[str, Tree]
    actions: dict[str, Tensor]
    legal: dict[str, Tensor]
    states: Tensor
    rewards: Tensor
    acted: Tensor
    terminated: Tensor
    labels: dict[str, Tensor] = field(default_factory=dict)

    @property
    def goes_on(self) -> Tensor:
        """(B, T, N) bool: whether the next observation's value counts for the agent."""
        return self.acted & ~self.terminated

    @property
    def counts_next(self) -> Tensor:
        """(B, T, N) bool: whose next values make up the team's next value.

        Of those who act in the next step; after an episode's last, of those who were cut off in it.
        """
        follows = nn.functional.pad(self.acted[:, 1:], (0, 0, 0, 1))
        return torch.where(follows.any(dim=-1, keepdim=True), follows, self.goes_on)

    def rows(self, rows: Tensor) -> "Batch":
        """Return some of the episodes, by their numbers."""

        def pick(part: Tensor) -> Tensor:
            return part[rows]

        return Batch(
            {name: over(pick, tree) for name, tree in self.observations.items()},
            over(pick, self.actions), over(pick, self.legal), self.states[rows], self.rewards[rows], self.acted[rows],
            self.terminated[rows], over(pick, self.labels),
        )  # fmt: skip

    def team(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return the team's reward (the mean of those who act), whether it goes on, whether it acts: (B, T, 1)."""
        acting = self.acted.sum(dim=-1, keepdim=True)
        reward = (self.rewards * self.acted).sum(dim=-1, keepdim=True) / acting.clamp(min=1)
        return reward, self.counts_next.any(dim=-1, keepdim=True), acting > 0


@dataclass(frozen=True)
class Unrolled:
    """What the agents' networks make of a batch.

    Attributes:
        values: agent -> (B, T + 1, A).
        histories: agent -> (B, T + 1, H).
    """

    values: dict[str, Tensor]
    histories: dict[str, Tensor]


def unroll(agents: nn.ModuleDict, batch: Batch) -> Unrolled:
    """Return the values of all actions after each observation, each agent from its own history."""
    values, histories = {}, {}
    for name, agent in agents.items():
        last = nn.functional.pad(batch.actions[name], (1, 0), value=NO_ACTION)
        values[name], histories[name], _ = agent(batch.observations[name], last)
    return Unrolled(values, histories)


def greedy(values: dict[str, Tensor], batch: Batch) -> dict[str, Tensor]:
    """Return agent -> its best legal action after each observation, (B, T + 1)."""
    return {name: best_legal(value, batch.legal[name]) for name, value in values.items()}


def best_legal(values: Tensor, legal: Tensor) -> Tensor:
    """Return the best action (...) of values (..., A) among the legal ones (..., A)."""
    return values.masked_fill(~legal, -torch.inf).argmax(dim=-1)


def chosen(values: dict[str, Tensor], actions: dict[str, Tensor]) -> Tensor:
    """Return the values (B, T, N) of one action of each agent."""
    picked = [values[name].gather(-1, action.unsqueeze(-1)) for name, action in actions.items()]
    return torch.cat(picked, dim=-1)


def td_loss(
    online: Unrolled, target: Unrolled, mixer: nn.Module, target_mixer: nn.Module, batch: Batch, gamma: float
) -> dict[str, Tensor]:
    """Return the loss of IQL, VDN or QMIX: the mean squared error of Q against y (Rashid et al. 2018, section 4).

        y = r + gamma Q^-(tau', argmax_u Q(tau', u)),

    where Q is mixed, and Q^- comes from the target networks (double Q, van Hasselt et al. 2016). IQL has a Q and an r
    for each agent, VDN and QMIX have them for the team.
    """
    best = {name: action[:, 1:] for name, action in greedy(online.values, batch).items()}
    taken = chosen(_before(online.values), batch.actions) * batch.acted
    q = mixer(taken, batch.states[:, :-1])
    alone = q.shape[-1] > 1
    with torch.no_grad():
        counts_next = batch.goes_on if alone else batch.counts_next
        q_next = target_mixer(chosen(_after(target.values), best) * counts_next, batch.states[:, 1:])
        reward, goes_on, counts = (batch.rewards, batch.goes_on, batch.acted) if alone else batch.team()
        y = reward + gamma * goes_on * q_next
    return {"loss": mean_square(q - y, counts), "q": _mean(q.detach(), counts)}


def qtran_loss(
    online: Unrolled,
    target: Unrolled,
    networks: QtranNetworks,
    target_networks: QtranNetworks,
    batch: Batch,
    gamma: float,
) -> dict[str, Tensor]:
    """Return the loss of QTRAN-base (Son et al. 2019, section 3): L_td + L_opt + L_nopt.

    With Q' = sum_i Q_i, u the joint action that was taken and u* that of the agents' own argmax, theorem 1 asks that

        Q'(tau, u) - Q_jt(tau, u) + V_jt(tau)  is 0 for u = u* (4a), and >= 0 for every other u (4b).

    Then u* is also the argmax of Q_jt, whatever Q_jt is. QMIX restricts Q_jt to functions that rise with the Q_i; QTRAN
    does not, and asks for agreement by losses instead:

        L_td   = (Q_jt(tau, u) - y)^2,  y = r + gamma Q_jt^-(tau', u'*)
        L_opt  = (Q'(tau, u*) - Q_jt(tau, u*) + V_jt(tau))^2               with Q_jt held fixed
        L_nopt = min(Q'(tau, u) - Q_jt(tau, u) + V_jt(tau), 0)^2           with Q_jt held fixed

    An agent that does not act has no action (zeros instead of a one-hot) in Q_jt, and none of its values in Q'.
    """
    reward, goes_on, counts = batch.team()
    best = greedy(online.values, batch)
    best_now = {name: action[:, :-1] for name, action in best.items()}
    best_next = {name: action[:, 1:] for name, action in best.items()}
    histories, state = _listed(online.histories, slice(None, -1)), batch.states[:, :-1]

    q_joint = networks.q_joint(histories, _one_hot(online, batch.actions, batch.acted), state)
    with torch.no_grad():
        after = _listed(target.histories, slice(1, None))
        q_next = target_networks.q_joint(after, _one_hot(online, best_next, batch.counts_next), batch.states[:, 1:])
        y = reward + gamma * goes_on * q_next
        q_joint_best = networks.q_joint(histories, _one_hot(online, best_now, batch.acted), state)
    v_joint = networks.v_joint(histories, state)

    now = _before(online.values)
    sum_best = (chosen(now, best_now) * batch.acted).sum(dim=-1, keepdim=True)
    sum_taken = (chosen(now, batch.actions) * batch.acted).sum(dim=-1, keepdim=True)
    td = mean_square(q_joint - y, counts)
    optimal = mean_square(sum_best - q_joint_best + v_joint, counts)
    other = mean_square((sum_taken - q_joint.detach() + v_joint).clamp(max=0), counts)
    parts = {"td": td.detach(), "opt": optimal.detach(), "nopt": other.detach()}
    return {"loss": td + optimal + other, "q": _mean(q_joint.detach(), counts), **parts}


def mean_square(error: Tensor, counts: Tensor) -> Tensor:
    """Return the mean square of the errors that count; both (B, T, M)."""
    if error.shape != counts.shape:
        raise ValueError(f"errors {tuple(error.shape)} and mask {tuple(counts.shape)} differ in shape")
    return _mean(error.square(), counts)


def _mean(numbers: Tensor, counts: Tensor) -> Tensor:
    return (numbers * counts).sum() / counts.sum()


def _before(values: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name: value[:, :-1] for name, value in values.items()}


def _after(values: dict[str, Tensor]) -> dict[str, Tensor]:
    return {name: value[:, 1:] for name, value in values.items()}


def _listed(histories: dict[str, Tensor], steps: slice) -> list[Tensor]:
    return [history[:, steps] for history in histories.values()]


def _one_hot(unrolled: Unrolled, actions: dict[str, Tensor], acts: Tensor) -> list[Tensor]:
    """Return each agent's actions (B, T, A) as one-hot; zeros where it does not act, as ``acts`` (B, T, N) says."""
    sizes = [value.shape[-1] for value in unrolled.values.values()]
    rows = zip(actions.values(), sizes, acts.unbind(dim=-1), strict=True)
    return [nn.functional.one_hot(action, size) * acting.unsqueeze(-1).float() for action, size, acting in rows]
