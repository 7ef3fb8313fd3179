"""Imitation of an expert in the states that the learner itself comes to (DAgger, Ross et al. 2011).

https://arxiv.org/abs/1011.0686. Cloning from stored episodes knows only states that the expert comes to; here the
expert says what it would do while the learner acts more and more by itself, so it learns to get out of its own errors.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.gradient import add_grounding, descend
from chmarl_pb.learning.algorithms.losses import unroll
from chmarl_pb.learning.algorithms.on_policy import set_learning_rates
from chmarl_pb.learning.components import best_action
from chmarl_pb.learning.config import RunConfig, amount, count, natural, share
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import NO_LABEL, Choose
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.spaces import LearnerInterface
from chmarl_pb.learning.storage.checkpoint import fill, fill_optimizer


@dataclass(frozen=True)
class DAggerConfig(RunConfig):
    """Imitation of an expert that is asked in every state the learner comes to (DAgger, Ross et al. 2011).

    >>> from functools import partial
    >>> from chmarl_pb.learning import train
    >>> config = DAggerConfig(episodes=2, horizon=3, envs=2, batch_size=2, features=8, hidden=8)
    >>> env_fn = partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=3)
    >>> result = train(env_fn, "imitation", config, expert=partial(chmarl_pb.make_policy, "belief"))
    >>> config.expert_share(0), config.expert_share(1)
    (1.0, 0.0)

    Attributes:
        expert: name of what is imitated: on the command line a built-in policy, "belief", "search", or "planner",
            which knows the world and never has to look for things; ``train`` writes down here what it is given.
        gradient_steps: after each rollout.
        beta: share of the actions that the expert takes at first; it falls linearly to 0 in the first half.
        greedy_share: share of the rollouts in which the learner's own actions are its best ones, as in evaluation,
            where it may repeat itself for ever; in the others they are drawn by its probabilities.
        anneal: share of the episodes, the last ones, in which the learning rate falls linearly, to 0 after the last
            gradient step; 0: it stays as it is.
    """

    episodes: int = count(3_000)
    learning_rate: float = amount(1e-3)
    graph_pool: str = "gated"
    expert: str = "belief"
    gradient_steps: int = natural(4)
    beta: float = share(1.0)
    greedy_share: float = share(0.0)
    anneal: float = share(0.0)

    def expert_share(self, episodes: int) -> float:
        """Return the share of actions that the expert takes after a number of episodes."""
        return self.beta * max(1 - 2 * episodes / self.episodes, 0.0)

    def is_greedy(self, episodes: int) -> bool:
        """Return whether the learner's own actions of the next rollout are its best ones."""
        rollout = episodes // self.envs
        return int((rollout + 1) * self.greedy_share) > int(rollout * self.greedy_share)

    def rate_share(self, episodes: int) -> float:
        """Return the share of the learning rate that is left when a number of episodes were learned from before."""
        return min((self.episodes - episodes) / (self.anneal * self.episodes), 1.0) if self.anneal else 1.0


class DAgger:
    """Learns each agent's actions from an expert's.

    Unlike Ross et al., a few gradient steps on the newest ``buffer_size`` episodes follow each rollout, in the place of
    a new learner of all data so far, and the expert's share falls linearly.

    Attributes:
        agents: agent -> its network; its values are logits of the actions.
        updates: gradient steps that were taken.
    """

    def __init__(self, algorithm: str, interface: LearnerInterface, config: DAggerConfig):
        """Make networks whose first weights depend on ``config.seed`` alone."""
        self.algorithm, self.config, self.updates = algorithm, config, 0
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.agents = make_agents(interface.observations, interface.actions, config)
        self._optimizer = torch.optim.Adam(self.agents.parameters(), lr=config.learning_rate, fused=True)

    def to(self, device: torch.device) -> None:
        """Move the networks to a device, before the first gradient step."""
        self.agents.to(device)

    def choose(self, episodes: int) -> Choose:
        """Return how to act after a number of episodes: a share of the actions is the expert's, others are drawn."""
        return expert_mixture(self.config.expert_share(episodes), self.config.is_greedy(episodes))

    def learn(self, replay: ReplayBuffer, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that follow a rollout of episodes."""
        before = max(replay.added - self.config.envs, 0)
        set_learning_rates(self._optimizer, (self.config.learning_rate,), self.config.rate_share(before))
        for _ in range(self.config.gradient_steps):
            batch = replay.sample(self.config.batch_size, rng)
            yield batch, self.update(batch)

    def update(self, batch: Batch) -> dict[str, float]:
        """Take one gradient step and return the losses, each agent's and their sum."""
        values = unroll(self.agents, batch).values
        losses = {
            f"{name}_loss": imitation_loss(values[name][:, :-1], labels) for name, labels in _labels(batch).items()
        }
        losses["loss"] = torch.stack(list(losses.values())).sum()
        metrics = add_grounding(losses, self.agents, batch, self.config.grounding_coef)
        self.updates += 1
        return descend(metrics, self._optimizer, self.config.max_grad_norm, self.agents.parameters())

    def state(self) -> dict[str, Any]:
        """Return all that the learner needs to go on."""
        return {
            "networks": self.agents.state_dict(), "optimizer": self._optimizer.state_dict(), "updates": self.updates,
        }  # fmt: skip

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state that comes from a file.

        Raises:
            CheckpointError: it is of another architecture.
        """
        fill(self.agents, state["networks"], path)
        fill_optimizer(self._optimizer, state["optimizer"], path)
        self.updates = state["updates"]


def imitation_loss(logits: Tensor, labels: Tensor) -> Tensor:
    """Return the cross-entropy of labels (B, T, K) under logits (B, T, K, A), summed over the components.

    Of each component it is the mean over the steps in which it has a label; 0 where there is none.
    """
    parts = zip(logits.unbind(dim=-2), labels.unbind(dim=-1), strict=True)
    return torch.stack([_cross_entropy(of_part, wanted) for of_part, wanted in parts]).sum()


def _cross_entropy(logits: Tensor, labels: Tensor) -> Tensor:
    """Return the mean cross-entropy of labels (B, T) under logits (B, T, A), where there is a label."""
    labelled = labels != NO_LABEL
    if not labelled.any():
        return 0 * logits.sum()
    return nn.functional.cross_entropy(logits[labelled], labels[labelled])


def expert_mixture(expert_share: float, greedy: bool = False) -> Choose:
    """Return how to act: as the expert says in a share of the steps, else by the networks' probabilities."""

    def choose(values: Tensor, action_mask: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        own = best_action(values, action_mask).numpy() if greedy else draw(values, action_mask, rng)
        follows = rng.random((len(own), 1)) < expert_share  # in all components of an action
        return np.where(follows & (labels != NO_LABEL), labels, own)

    return choose


def draw(values: Tensor, action_mask: Tensor, rng: np.random.Generator) -> np.ndarray:
    """Return allowed actions (B, K), drawn with the probabilities softmax(values), by the Gumbel-max trick."""
    noise = torch.from_numpy(rng.gumbel(size=tuple(values.shape)))
    return (values + noise).masked_fill(~action_mask, -torch.inf).argmax(dim=-1).numpy()


def _labels(batch: Batch) -> dict[str, Tensor]:
    """Return the labels of the steps in which an agent acts; ``NO_LABEL`` elsewhere."""
    acted = dict(zip(batch.labels, batch.acted.unbind(dim=-1), strict=True))
    return {name: labels.masked_fill(~acted[name].unsqueeze(-1), NO_LABEL) for name, labels in batch.labels.items()}
