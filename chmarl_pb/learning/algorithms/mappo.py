"""MAPPO (Yu et al. 2022, https://arxiv.org/abs/2103.01955): actors of their own, one critic that knows the state.

Each agent acts on its own history; the critic, which is needed in training alone, sees the global state. The reward is
the team's. An episode that was cut off is worth, beyond its end, what the critic says of its last state; one that has
ended is worth nothing there.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.dagger import draw
from chmarl_pb.learning.algorithms.gradient import add_grounding, descend, evaluating
from chmarl_pb.learning.algorithms.losses import lambda_returns, unroll
from chmarl_pb.learning.algorithms.normalizer import Normalizer, update_and_preserve
from chmarl_pb.learning.algorithms.on_policy import minibatches, new_episodes, set_learning_rates
from chmarl_pb.learning.components import taken
from chmarl_pb.learning.config import RunConfig, amount, count, natural, share
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import Choose
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.spaces import LearnerInterface
from chmarl_pb.learning.storage.checkpoint import fill, fill_optimizer


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
        buffer_size: new episodes that are learned from at once, at least.
        memory_gib: bound of their memory; too little is an error.
        start: file of weights of agents to begin with (``best.pt``); "" for random ones.
        critic_starts: episodes that only the critic learns from at first, at least, beside actors that begin with
            ``start``; half of all in a shorter run.
        n_epochs: passes over the episodes that are learned from at once.
        gamma: discount of one step.
        gae_lambda: of generalised advantage estimation.
        clip_range: how far the ratio of probabilities may leave 1.
        ent_coef: weight of the policy's entropy.
        critic_units: units of the critic's layers.
        critic_learning_rate: of Adam for the critic; both rates fall linearly, to 0 after the last gradient step.
        normalize_values: whether the critic gives values with mean 0 and deviation 1 (PopArt).
        huber_delta: error of a value from which on the loss is linear; 0: the plain squared error, not halved.
        standardize_state: whether the critic sees the state with mean 0 and deviation 1.
    """

    on_policy: ClassVar[bool] = True

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
    normalize_values: bool = True
    huber_delta: float = amount(10.0)
    standardize_state: bool = True

    @property
    def first_weights(self) -> str:
        """The file of ``start``."""
        return self.start


@dataclass(frozen=True)
class Advantages:
    """What is learned from at once; N agents.

    Attributes:
        log_probabilities: (B, T, N) of the actions that were taken, when they were taken.
        advantages: (B, T), with mean 0 and deviation 1 over the real steps, if there are several.
        returns: (B, T) what the critic should say, in units of the rewards until they are normalized.
    """

    log_probabilities: Tensor
    advantages: Tensor
    returns: Tensor


class Mappo:
    """Learns the agents' policies and a critic.

    Of what Yu et al. advise, there are value normalisation (PopArt), a Huber loss and few epochs. Unlike theirs,
    batches are split into minibatches of ``batch_size`` episodes; values are not clipped; the critic sees the global
    state alone, standardized, and has no memory; agents share no weights; whole episodes are learned from, from their
    starts on, and not chunks of 10 steps; there is no orthogonal initialisation and no layer norm; and the learning
    rates fall linearly.

    Attributes:
        agents: agent -> its network; its values are logits of the actions.
        critic: state, standardized -> value, normal; see :meth:`value`.
        updates: gradient steps that were taken.
    """

    def __init__(self, algorithm: str, interface: LearnerInterface, config: MappoConfig):
        """Make networks whose first weights depend on ``config.seed`` alone."""
        self.algorithm, self.config = algorithm, config
        self.updates, self._learned = 0, 0
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.agents = make_agents(interface.observations, interface.actions, config)
            units = config.critic_units
            self._head = nn.Linear(units, 1)
            self.critic = nn.Sequential(
                nn.Linear(interface.state_size, units), nn.ReLU(), nn.Linear(units, units), nn.ReLU(), self._head
            )  # fmt: skip
        self._networks = nn.ModuleDict({"agents": self.agents, "critic": self.critic})
        self._states = Normalizer(interface.state_size) if config.standardize_state else None
        self._values = Normalizer(1) if config.normalize_values else None
        scales = {"of_states": self._states, "of_values": self._values}
        self._scales = nn.ModuleDict({name: scale for name, scale in scales.items() if scale is not None})
        self._rates = config.learning_rate, config.critic_learning_rate
        groups = [{"params": list(part.parameters())} for part in (self.agents, self.critic)]
        self._optimizer = torch.optim.Adam(groups, eps=1e-5, fused=True)

    def to(self, device: torch.device) -> None:
        """Move the networks to a device, before the first gradient step."""
        self._networks.to(device)
        self._scales.to(device)

    def choose(self, episodes: int) -> Choose:
        """Return how to act: by the networks' probabilities."""
        return lambda values, action_mask, labels, rng: draw(values, action_mask, rng)

    def learn(self, replay: ReplayBuffer, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that are due once there are enough new episodes, and at the end of the run."""
        new = new_episodes(self.config, replay.added, self._learned)
        if not new:
            return
        before, self._learned = self._learned, replay.added
        set_learning_rates(self._optimizer, self._rates, 1 - before / self.config.episodes)
        batch = replay.sample(new, rng, newest=new)
        if self._states is not None:
            self._states.update(batch.states, batch.real.any(dim=-1, keepdim=True))
        learned = self.compute_gae(batch)
        learned = replace(learned, returns=self._normal(learned.returns, batch))
        alone = min(self.config.critic_starts, self.config.episodes // 2) if self.config.start else 0
        actors = before >= alone
        for rows in minibatches(len(batch.states), self.config.n_epochs, self.config.batch_size, rng):
            part = batch.rows(rows)
            chosen = Advantages(learned.log_probabilities[rows], learned.advantages[rows], learned.returns[rows])
            yield part, self.update(part, chosen, actors)

    @torch.no_grad()
    def value(self, states: Tensor) -> Tensor:
        """Return what the critic says of states (..., S), (...), in units of the rewards."""
        normal = self._normal_values(states)
        return normal if self._values is None else self._values.denormalize(normal.unsqueeze(-1)).squeeze(-1)

    def _normal_values(self, states: Tensor) -> Tensor:
        seen = states if self._states is None else self._states.normalize(states)
        normal: Tensor = self.critic(seen).squeeze(-1)
        return normal

    def _normal(self, returns: Tensor, batch: Batch) -> Tensor:
        """Return what the critic should give for returns (B, T), which are taken in."""
        if self._values is None:
            return returns
        column = returns.unsqueeze(-1)
        update_and_preserve(self._values, self._head, column, batch.acted.any(dim=-1, keepdim=True))
        return self._values.normalize(column).squeeze(-1)

    @torch.no_grad()
    def compute_gae(self, batch: Batch) -> Advantages:
        """Return advantages and returns of all steps by generalised advantage estimation (Schulman et al. 2016).

        Networks are in evaluation mode for it, as they were when the actions were drawn.
        """
        with evaluating(self.agents, self.critic):
            return self._compute_gae(batch)

    def _compute_gae(self, batch: Batch) -> Advantages:
        reward, not_done, team_mask = batch.team()
        mask, values = team_mask.squeeze(-1), self.value(batch.states)
        following, config = values[:, 1:].unsqueeze(-1), self.config
        returns = lambda_returns(reward, not_done, following, team_mask, config.gamma, config.gae_lambda).squeeze(-1)
        advantages = (returns - values[:, :-1]) * mask
        real = advantages[mask]
        # One step has nothing to be compared with.
        normal = (advantages - real.mean()) / (real.std() + 1e-6) if len(real) > 1 else advantages
        return Advantages(self._log_probabilities(batch)[0], normal, returns * mask)

    def update(self, batch: Batch, learned: Advantages, train_actors: bool) -> dict[str, float]:
        """Take one gradient step, of the critic alone if ``train_actors`` is false, and return what goes with it."""
        mask = batch.acted.any(dim=-1)
        value_loss = self._value_loss(self._normal_values(batch.states[:, :-1])[mask], learned.returns[mask])
        metrics = {"value_loss": value_loss, "loss": value_loss}
        if train_actors:
            log_probabilities, entropy = self._log_probabilities(batch)
            ratio = (log_probabilities - learned.log_probabilities).exp()
            advantage = learned.advantages.unsqueeze(-1)
            bounded = ratio.clamp(1 - self.config.clip_range, 1 + self.config.clip_range)
            surrogate = torch.minimum(ratio * advantage, bounded * advantage)
            metrics |= {
                "policy_loss": -surrogate[batch.acted].mean(),
                "entropy": entropy[batch.acted].mean(),
                "clipped": (ratio != bounded)[batch.acted].float().mean(),
            }
            metrics["loss"] = value_loss + metrics["policy_loss"] - self.config.ent_coef * metrics["entropy"]
            metrics = add_grounding(metrics, self.agents, batch, self.config.grounding_coef)
        self.updates += 1
        parts = self.agents.parameters(), self.critic.parameters()
        return descend(metrics, self._optimizer, self.config.max_grad_norm, *parts)

    def _value_loss(self, values: Tensor, wanted: Tensor) -> Tensor:
        delta = self.config.huber_delta
        if not delta:
            return (values - wanted).square().mean()
        return nn.functional.huber_loss(values, wanted, delta=delta)

    def _log_probabilities(self, batch: Batch) -> tuple[Tensor, Tensor]:
        """Return the log-probabilities of the actions that were taken, and the entropies, both (B, T, N).

        Components of an action are drawn independently of each other, so both are sums over them.
        """
        done, entropies = [], []
        for name, values in unroll(self.agents, batch).values.items():
            action_mask = batch.action_mask[name][:, :-1]
            logs = values[:, :-1].masked_fill(~action_mask, -1e9).log_softmax(dim=-1)
            done.append(taken(logs, batch.actions[name]))
            entropies.append(-(logs.exp() * logs).sum(dim=(-2, -1)))
        return torch.stack(done, dim=-1), torch.stack(entropies, dim=-1)

    def state(self) -> dict[str, Any]:
        """Return all that the learner needs to go on."""
        return {
            "networks": self._networks.state_dict(), "optimizer": self._optimizer.state_dict(),
            "updates": self.updates, "learned": self._learned, "scales": self._scales.state_dict(),
        }  # fmt: skip

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state that comes from a file.

        Raises:
            CheckpointError: it is of another architecture.
        """
        fill(self._networks, state["networks"], path)
        fill_optimizer(self._optimizer, state["optimizer"], path)
        fill(self._scales, state.get("scales", {}), path)  # older checkpoints have none
        self.updates, self._learned = state["updates"], state["learned"]
