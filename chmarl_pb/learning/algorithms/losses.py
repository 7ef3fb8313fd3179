"""What networks make of a batch of episodes, and the loss of IQL, VDN and QMIX.

A batch has T steps and T + 1 observations. Actions have K components with A values at most. An agent counts at a step
if it acts there; a truncated episode is bootstrapped from its last observation, a terminated one is not.
"""

from dataclasses import dataclass
from typing import Any, cast

import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.mixers import Mixer, mixed
from chmarl_pb.learning.algorithms.normalizer import Normalizer
from chmarl_pb.learning.components import best_action, taken
from chmarl_pb.learning.networks.agents import NO_ACTION
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.spaces import Tree, tree_map


@dataclass(frozen=True)
class Unrolled:
    """What the agents' networks make of a batch.

    Attributes:
        values: agent -> (B, T + 1, K, A).
        hidden_states: agent -> (B, T + 1, H).
    """

    values: dict[str, Tensor]
    hidden_states: dict[str, Tensor]


def unroll(agents: nn.ModuleDict, batch: Batch) -> Unrolled:
    """Return the values of all actions after each observation, each agent from its own history."""
    values, hidden_states, real = {}, {}, batch.real
    for number, (name, agent) in enumerate(agents.items()):
        last = nn.functional.pad(batch.actions[name], (0, 0, 1, 0), value=NO_ACTION)
        values[name], hidden_states[name], _ = agent(batch.observations[name], last, real=real[..., number])
    return Unrolled(values, hidden_states)


def grounding(agents: nn.ModuleDict, batch: Batch, weight: float) -> dict[str, Tensor]:
    """Return ``grounding_loss``, which teaches encoders the classes that instructions name, times a weight.

    All learners add it to their own loss. There is none if the weight is 0.
    """
    losses = [
        cast(Any, agent).encoder.grounding_loss(_first(batch.observations[name]))
        for name, agent in agents.items()
        if weight
    ]
    return {"grounding_loss": weight * torch.stack(losses).sum()} if losses else {}


def _first(observation: Tree) -> Tree:
    """Return the first observations (B, 1, ...): instructions stay the same."""
    return tree_map(lambda part: part[:, :1], observation)


def greedy_actions(values: dict[str, Tensor], batch: Batch) -> dict[str, Tensor]:
    """Return agent -> its best allowed action after each observation, (B, T + 1, K)."""
    return {name: best_action(value, batch.action_mask[name]) for name, value in values.items()}


def chosen(values: dict[str, Tensor], actions: dict[str, Tensor]) -> Tensor:
    """Return the values (B, T, N) of one action of each agent: the sums of those of its components."""
    return torch.stack([taken(values[name], action) for name, action in actions.items()], dim=-1)


@dataclass(frozen=True)
class Returns:
    """How the values that are learned are made of rewards and later values.

    Attributes:
        gamma: discount of one step.
        td_lambda: 0 looks one step ahead, 1 to the end of the episode.
        scale: of values: networks give normal ones; None: they give values as they are.
    """

    gamma: float
    td_lambda: float = 0.0
    scale: Normalizer | None = None

    def denormalize(self, values: Tensor) -> Tensor:
        """Return values (B, T, M) in units of the rewards from what networks give."""
        return values if self.scale is None else self.scale.denormalize(values)

    def normalize(self, targets: Tensor) -> Tensor:
        """Return what networks should give for targets (B, T, M) in units of the rewards."""
        return targets if self.scale is None else self.scale.normalize(targets)

    def update_scale(self, reward: Tensor, not_done: Tensor, mask: Tensor) -> None:
        """Let the scale follow the observed returns, as if an episode that was cut off went on alike.

        All are (B, T, M): rewards, whether there is a value after the step, and which steps were taken.

        It must not follow the targets: they hold the networks' own values, which the scale makes real, so that it would
        follow itself. On simple_spread its deviation grew by a tenth with each gradient step, until it was no number.
        """
        if self.scale is not None:
            each = (reward * mask).sum(dim=(0, 1)) / mask.sum(dim=(0, 1)).clamp(min=1)  # (M)
            onward = each / (1 - self.gamma) if self.gamma < 1 else torch.zeros_like(each)
            had = lambda_returns(reward, not_done, onward.expand_as(reward), mask, self.gamma, 1.0)
            self.scale.update(had, mask)


def td_loss(
    online: Unrolled, target: Unrolled, mixer: Mixer, target_mixer: Mixer, batch: Batch, returns: Returns
) -> dict[str, Tensor]:
    """Return the loss of IQL, VDN or QMIX: the mean squared error of Q against y, see :func:`td_targets`."""
    y, mask = td_targets(online, target, target_mixer, batch, returns)
    return q_loss(online, mixer, batch, returns.normalize(y), mask)


def q_loss(online: Unrolled, mixer: Mixer, batch: Batch, y: Tensor, mask: Tensor) -> dict[str, Tensor]:
    """Return the mean squared error of the mixed values of what was done against targets; both (B, T, M)."""
    q_taken = chosen(before(online.values), batch.actions) * batch.acted
    q = mixed(mixer, q_taken, batch.states[:, :-1])
    return {"loss": mean_square(q - y, mask), "q": mean(q.detach(), mask)}


@torch.no_grad()
def td_targets(
    online: Unrolled, target: Unrolled, target_mixer: Mixer, batch: Batch, returns: Returns
) -> tuple[Tensor, Tensor]:
    """Return what Q should be, in units of the rewards, and what counts (Rashid et al. 2018, section 4).

        y = r + gamma Q^-(tau', argmax_u Q(tau', u)),

    where Q is mixed, and Q^- comes from the target networks (double Q, van Hasselt et al. 2016, as PyMARL has it and
    Rashid et al. do not). IQL has a Q and an r for each agent (M = N), VDN and QMIX have them for the team (M = 1).
    With a lambda, y looks further ahead, see :func:`lambda_returns`.
    """
    best = {name: action[:, 1:] for name, action in greedy_actions(online.values, batch).items()}
    per_agent = target_mixer.per_agent
    next_mask = batch.not_done if per_agent else batch.next_mask
    reward, not_done, mask = (batch.rewards, batch.not_done, batch.acted) if per_agent else batch.team()
    returns.update_scale(reward, not_done, mask)
    q_next = returns.denormalize(
        mixed(target_mixer, chosen(after(target.values), best) * next_mask, batch.states[:, 1:])
    )
    return lambda_returns(reward, not_done, q_next, mask, returns.gamma, returns.td_lambda), mask


def lambda_returns(
    reward: Tensor, not_done: Tensor, following: Tensor, mask: Tensor, gamma: float, td_lambda: float
) -> Tensor:
    """Return the lambda-return of each step: y = r + gamma ((1 - lambda) v' + lambda y'), by v' alone after the last.

    Of greedy values v' this is Peng's Q(lambda) (Peng and Williams 1994), which does not correct for exploration.

    Args:
        reward: (B, T, M).
        not_done: (B, T, M) bool, whether there is a value after the step.
        following: (B, T, M) value v' after each step.
        mask: (B, T, M) bool, which steps were taken.
        gamma: discount of one step.
        td_lambda: weight of what lies further ahead.
    """
    ahead = following.clone()
    for step in reversed(range(reward.shape[1] - 1 if td_lambda else 0)):
        later = reward[:, step + 1] + gamma * not_done[:, step + 1] * ahead[:, step + 1]
        mixed = (1 - td_lambda) * following[:, step] + td_lambda * later
        ahead[:, step] = torch.where(mask[:, step + 1], mixed, following[:, step])
    return reward + gamma * not_done * ahead


def mean_square(error: Tensor, mask: Tensor) -> Tensor:
    """Return the mean square of the errors that count; both (B, T, M)."""
    if error.shape != mask.shape:
        raise ValueError(f"errors {tuple(error.shape)} and mask {tuple(mask.shape)} differ in shape")
    return mean(error.square(), mask)


def mean(numbers: Tensor, mask: Tensor) -> Tensor:
    """Return the mean of the numbers that count; both (B, T, M)."""
    return (numbers * mask).sum() / mask.sum()


def before(values: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return the values of the steps, without those after the last."""
    return {name: value[:, :-1] for name, value in values.items()}


def after(values: dict[str, Tensor]) -> dict[str, Tensor]:
    """Return the values after each step."""
    return {name: value[:, 1:] for name, value in values.items()}
