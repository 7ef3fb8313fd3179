"""Whole episodes as a batch.

A batch has T steps and T + 1 observations. Actions have K components with A values at most. An agent counts at a step
if it acts there; a truncated episode is bootstrapped from its last observation, a terminated one is not.
"""

from dataclasses import dataclass, field

import torch
from torch import Tensor, nn

from chmarl_pb.learning.spaces import Tree, tree_map


@dataclass(frozen=True)
class Batch:
    """Episodes as tensors, padded to the longest.

    Attributes:
        observations: agent -> (B, T + 1, ...).
        actions: agent -> (B, T, K) int64.
        action_mask: agent -> (B, T + 1, K, A) bool, the actions that it may take.
        states: (B, T + 1, S).
        rewards: (B, T, N).
        acted: (B, T, N) bool, whether the agent took part in the step.
        terminated: (B, T, N) bool, whether the step ended the agent's task.
        labels: agent -> (B, T, K) int64, what an expert would have done, or -1.
    """

    observations: dict[str, Tree]
    actions: dict[str, Tensor]
    action_mask: dict[str, Tensor]
    states: Tensor
    rewards: Tensor
    acted: Tensor
    terminated: Tensor
    labels: dict[str, Tensor] = field(default_factory=dict)

    @property
    def not_done(self) -> Tensor:
        """(B, T, N) bool: whether the next observation's value mask for the agent."""
        return self.acted & ~self.terminated

    @property
    def next_mask(self) -> Tensor:
        """(B, T, N) bool: whose next values make up the team's next value.

        Of those who act in the next step; after an episode's last, of those who were cut off in it.
        """
        follows = nn.functional.pad(self.acted[:, 1:], (0, 0, 0, 1))
        return torch.where(follows.any(dim=-1, keepdim=True), follows, self.not_done)

    def rows(self, rows: Tensor) -> "Batch":
        """Return some of the episodes, by their numbers."""

        def pick(part: Tensor) -> Tensor:
            return part[rows]

        return Batch(
            {name: tree_map(pick, tree) for name, tree in self.observations.items()},
            tree_map(pick, self.actions), tree_map(pick, self.action_mask), self.states[rows], self.rewards[rows],
            self.acted[rows], self.terminated[rows], tree_map(pick, self.labels),
        )  # fmt: skip

    @property
    def real(self) -> Tensor:
        """(B, T + 1, N) bool: which observations are more than padding, up to the one after an agent's last step."""
        later = self.acted.flip(1).cumsum(dim=1).flip(1) > 0
        return nn.functional.pad(later, (0, 0, 1, 0), value=True)

    def team(self) -> tuple[Tensor, Tensor, Tensor]:
        """Return the team's reward (the mean of those who act), whether it goes on, whether it acts: (B, T, 1)."""
        acting = self.acted.sum(dim=-1, keepdim=True)
        reward = (self.rewards * self.acted).sum(dim=-1, keepdim=True) / acting.clamp(min=1)
        return reward, self.next_mask.any(dim=-1, keepdim=True), acting > 0
