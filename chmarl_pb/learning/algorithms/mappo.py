"""MAPPO (Yu et al. 2022, https://arxiv.org/abs/2103.01955): actors of their own, one critic that knows the state.

Each agent acts on its own history; the critic, which is needed in training alone, sees the global state. The reward is
the team's. An episode that was cut off is worth, beyond its end, what the critic says of its last state; one that has
ended is worth nothing there.

Unlike Yu et al., there is no value normalisation, no clipping of values and no Huber loss; the critic sees the global
state alone and has no memory; agents share no weights; advantages are normalised over all episodes that are learned
from at once; and the learning rates fall linearly.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.dagger import draw
from chmarl_pb.learning.algorithms.losses import Batch, unroll
from chmarl_pb.learning.config import RunConfig, amount, count, natural, share
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.runs.checkpoint import fill, fill_optimizer
from chmarl_pb.learning.runs.collect import Choose
from chmarl_pb.learning.runs.replay_buffer import ReplayBuffer
from chmarl_pb.learning.spaces import Interface


@dataclass(frozen=True)
class MappoConfig(RunConfig):
    """MAPPO (Yu et al. 2022, https://arxiv.org/abs/2103.01955): an actor each, and a critic that knows the state.

    It learns from all episodes since it last did, as soon as they are ``buffer_size``, and at the end from the rest.

    >>> from functools import partial
    >>> from chmarl_pb.learning import train
    >>> config = MappoConfig(episodes=2, horizon=3, envs=2, batch_size=2, features=8, hidden=8)
    >>> result = train(partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=3), "mappo", config)
    >>> sorted(result.agents)
    ['drone', 'humanoid']

    Attributes:
        learning_starts: episodes that are learned from the first time, if they are more than ``buffer_size``.
        start: file of weights of agents to begin with (``best.pt``); "" for random ones.
        critic_starts: episodes that only the critic learns from at first, beside actors that begin with ``start``.
        n_epochs: passes over the episodes that are learned from at once.
        gamma: discount of one step.
        gae_lambda: of generalised advantage estimation.
        clip_range: how far the ratio of probabilities may leave 1.
        ent_coef: weight of the policy's entropy.
        critic_units: units of the critic's layers.
        critic_learning_rate: of Adam for the critic; both rates fall linearly, to 0 after the last gradient step.
    """

    episodes: int = count(12_000)
    learning_starts: int = natural(0)
    buffer_size: int = count(128)
    max_grad_norm: float = amount(1.0)
    graph_pool: str = "gated"
    validation_interval: int = count(2_000)
    checkpoint_interval: int = count(2_000)
    start: str = ""
    critic_starts: int = natural(512)
    n_epochs: int = count(4)
    gamma: float = share(0.97)
    gae_lambda: float = share(0.95)
    clip_range: float = amount(0.2)
    ent_coef: float = amount(0.01)
    critic_units: int = count(128)
    critic_learning_rate: float = amount(1e-3)

    @property
    def kept(self) -> int:
        """Most episodes that are learned from at once: whole rollouts, from ``buffer_size`` on."""
        return -(-max(self.buffer_size, self.learning_starts) // self.envs) * self.envs

    @property
    def on_policy(self) -> bool:
        """All kept episodes are learned from at once."""
        return True

    @property
    def first_weights(self) -> str:
        """The file of ``start``."""
        return self.start


@dataclass(frozen=True)
class Rollout:
    """What is learned from at once; N agents.

    Attributes:
        log_probabilities: (B, T, N) of the actions that were taken, when they were taken.
        advantages: (B, T), with mean 0 and deviation 1 over the real steps, if there are several.
        returns: (B, T) what the critic should say.
    """

    log_probabilities: Tensor
    advantages: Tensor
    returns: Tensor


class Mappo:
    """Learns the agents' policies and a critic.

    Attributes:
        agents: agent -> its network; its values are logits of the actions.
        critic: state -> value.
        updates: gradient steps that were taken.
    """

    def __init__(self, algorithm: str, interface: Interface, config: MappoConfig):
        """Make networks whose first weights depend on ``config.seed`` alone."""
        self.algorithm, self.config = algorithm, config
        self.updates, self._learned = 0, 0
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.agents = make_agents(interface.observations, interface.actions, config)
            units = config.critic_units
            self.critic = nn.Sequential(
                nn.Linear(interface.state_size, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(),
                nn.Linear(units, 1),
            )  # fmt: skip
        self._networks = nn.ModuleDict({"agents": self.agents, "critic": self.critic})
        self._rates = config.learning_rate, config.critic_learning_rate
        groups = [{"params": list(part.parameters())} for part in (self.agents, self.critic)]
        self._optimizer = torch.optim.Adam(groups, eps=1e-5, fused=True)

    def to(self, device: torch.device) -> None:
        """Move the networks to a device, before the first gradient step."""
        self._networks.to(device)

    def choose(self, episodes: int) -> Choose:
        """Return how to act: by the networks' probabilities."""
        return lambda values, action_mask, labels, rng: draw(values, action_mask, rng)

    def learn(self, replay: ReplayBuffer, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that are due once there are enough new episodes, and at the end of the run."""
        new = replay.added - self._learned
        if not new or (new < self.config.buffer_size and replay.added < self.config.episodes):
            return
        self._anneal_learning_rate(self._learned)
        self._learned = replay.added
        batch = replay.sample(new, rng, newest=new)
        rollout = self.compute_gae(batch)
        actors = not self.config.start or replay.added > self.config.critic_starts
        for _ in range(self.config.n_epochs):
            order = torch.from_numpy(rng.permutation(len(batch.states)))
            for rows in order.split(self.config.batch_size):
                part = batch.rows(rows)
                chosen = Rollout(rollout.log_probabilities[rows], rollout.advantages[rows], rollout.returns[rows])
                yield part, self.update(part, chosen, actors)

    def _anneal_learning_rate(self, episodes: int) -> None:
        """Let the learning rates fall linearly with the episodes that were learned from before."""
        left = max(1 - episodes / self.config.episodes, 0.0)
        for group, rate in zip(self._optimizer.param_groups, self._rates, strict=True):
            group["lr"] = rate * left

    @torch.no_grad()
    def compute_gae(self, batch: Batch) -> Rollout:
        """Return advantages and returns of all steps by generalised advantage estimation (Schulman et al. 2016)."""
        reward, not_done, mask = (part.squeeze(-1) for part in batch.team())
        values = self.critic(batch.states).squeeze(-1)
        values, following = values[:, :-1] * mask, values[:, 1:] * not_done
        advantages, ahead = torch.zeros_like(values), values.new_zeros(len(values))
        for step in reversed(range(values.shape[1])):
            error = reward[:, step] + self.config.gamma * following[:, step] - values[:, step]
            ahead = (error + self.config.gamma * self.config.gae_lambda * ahead) * mask[:, step]
            advantages[:, step] = ahead
        real = advantages[mask]
        # One step has nothing to be compared with.
        normal = (advantages - real.mean()) / (real.std() + 1e-6) if len(real) > 1 else advantages
        return Rollout(self._log_probabilities(batch)[0], normal, advantages + values)

    def update(self, batch: Batch, rollout: Rollout, actors: bool) -> dict[str, float]:
        """Take one gradient step, of the critic alone if ``actors`` is false, and return what goes with it."""
        counts = batch.acted.any(dim=-1)
        error = self.critic(batch.states[:, :-1]).squeeze(-1) - rollout.returns
        value_loss = error[counts].square().mean()
        metrics = {"value_loss": value_loss}
        if actors:
            log_probabilities, entropy = self._log_probabilities(batch)
            ratio = (log_probabilities - rollout.log_probabilities).exp()
            advantage = rollout.advantages.unsqueeze(-1)
            bounded = ratio.clamp(1 - self.config.clip_range, 1 + self.config.clip_range)
            surrogate = torch.minimum(ratio * advantage, bounded * advantage)
            metrics |= {
                "policy_loss": -surrogate[batch.acted].mean(),
                "entropy": entropy[batch.acted].mean(),
                "clipped": (ratio != bounded)[batch.acted].float().mean(),
            }
        loss = value_loss + metrics.get("policy_loss", 0.0) - self.config.ent_coef * metrics.get("entropy", 0.0)
        self._optimizer.zero_grad()
        loss.backward()
        norm = nn.utils.clip_grad_norm_(self.agents.parameters(), self.config.max_grad_norm)
        nn.utils.clip_grad_norm_(self.critic.parameters(), self.config.max_grad_norm)
        self._optimizer.step()
        self.updates += 1
        return {"loss": float(loss.detach()), "gradient_norm": float(norm)} | {
            name: float(value.detach()) for name, value in metrics.items()
        }

    def _log_probabilities(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """Return the log-probabilities of the actions that were taken, and the entropies, both (B, T, N)."""
        taken, entropies = [], []
        for name, values in unroll(self.agents, batch).values.items():
            action_mask = batch.action_mask[name][:, :-1]
            logs = values[:, :-1].masked_fill(~action_mask, -1e9).log_softmax(dim=-1)
            taken.append(logs.gather(-1, batch.actions[name].unsqueeze(-1)).squeeze(-1))
            entropies.append(-(logs.exp() * logs).sum(dim=-1))
        return torch.stack(taken, dim=-1), torch.stack(entropies, dim=-1)

    def state(self) -> dict[str, Any]:
        """Return all that the learner needs to go on."""
        return {
            "networks": self._networks.state_dict(), "optimizer": self._optimizer.state_dict(),
            "updates": self.updates, "learned": self._learned,
        }  # fmt: skip

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state that comes from a file.

        Raises:
            CheckpointError: it is of another architecture.
        """
        fill(self._networks, state["networks"], path)
        fill_optimizer(self._optimizer, state["optimizer"], path)
        self.updates, self._learned = state["updates"], state["learned"]
