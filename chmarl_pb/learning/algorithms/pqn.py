"""PQN with VDN (Gallici et al. 2024, https://arxiv.org/abs/2407.04811): Q-learning without replay buffer and targets.

Episodes that were just played are learned from and thrown away. Lambda-returns of the networks' own values are what
they learn, and layer norm keeps that stable in the place of target networks.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import torch
from torch import nn

from chmarl_pb.learning.algorithms.gradient import add_grounding, descend, evaluating
from chmarl_pb.learning.algorithms.losses import Returns, q_loss, td_targets, unroll
from chmarl_pb.learning.algorithms.mixers import MIXERS, Mixer
from chmarl_pb.learning.algorithms.on_policy import minibatches, new_episodes, set_learning_rates
from chmarl_pb.learning.config import RunConfig, amount, count, natural, share
from chmarl_pb.learning.lookup import make_network
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import Choose, epsilon_after, epsilon_greedy
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.spaces import LearnerInterface
from chmarl_pb.learning.storage.checkpoint import fill, fill_optimizer


@dataclass(frozen=True)
class PqnConfig(RunConfig):
    """PQN (Gallici et al. 2024, https://arxiv.org/abs/2407.04811), by default with VDN.

    It learns from all episodes since it last did, as soon as they are ``buffer_size``, and at the end from the rest.

    >>> from functools import partial
    >>> from chmarl_pb.learning import train
    >>> config = PqnConfig(episodes=2, horizon=3, envs=2, batch_size=2, features=8, hidden=8)
    >>> result = train(partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=3), "pqn", config)
    >>> sorted(result.agents)
    ['drone', 'humanoid']

    Attributes:
        learning_starts: episodes that are learned from the first time, if they are more than ``buffer_size``.
        buffer_size: new episodes that are learned from at once, at least.
        memory_gib: bound of their memory; too little is an error.
        learning_rate: of RAdam at first; it falls linearly, to 0 after the last gradient step.
        mixer: a name in ``algorithms.mixers.MIXERS``, or ``module:name``.
        n_epochs: passes over the episodes that are learned from at once.
        gamma: discount of one step.
        td_lambda: how far targets look ahead: 0 one step, 1 to the end of the episode (Peng's Q(lambda)).
        exploration_initial_eps: share of random actions at first.
        exploration_final_eps: share of random actions in the end.
        exploration_fraction: share of the episodes over which epsilon falls linearly.
        embedding: hidden units of the mixer.
    """

    on_policy: ClassVar[bool] = True

    episodes: int = count(12_000)
    envs: int = count(16)
    batch_size: int = count(16)
    learning_starts: int = natural(0)
    buffer_size: int = count(32)
    learning_rate: float = amount(1e-3)
    layer_norm: bool = True
    mixer: str = "vdn"
    n_epochs: int = count(4)
    gamma: float = share(0.97)
    td_lambda: float = share(0.65)
    exploration_initial_eps: float = share(1.0)
    exploration_final_eps: float = share(0.05)
    exploration_fraction: float = share(0.4)
    embedding: int = count(32)


class Pqn:
    """Learns the agents' values, joined by a mixer, from the newest episodes alone.

    Unlike Gallici et al., agents share no weights, whole episodes are learned from and not chunks of some steps, and
    layer norm stands after the encoder and after the GRU, not after every layer.

    Attributes:
        agents: agent -> its network.
        mixer: what joins the agents' values.
        updates: gradient steps that were taken.
    """

    def __init__(self, algorithm: str, interface: LearnerInterface, config: PqnConfig):
        """Make networks whose first weights depend on ``config.seed`` alone.

        Raises:
            ValueError: there is no such mixer or encoder.
        """
        self.algorithm, self.config, self._returns = algorithm, config, Returns(config.gamma, config.td_lambda)
        self.updates, self._learned = 0, 0
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.agents = make_agents(interface.observations, interface.actions, config)
            given = (len(interface.agents), interface.state_size, config.embedding)
            self.mixer: Any = make_network("mixer", config.mixer, MIXERS, *given, kind=Mixer)
        self._networks = nn.ModuleDict({"agents": self.agents, "mixer": self.mixer})
        self._weights = [weight for weight in self._networks.parameters() if weight.requires_grad]
        self._optimizer = torch.optim.RAdam(self._weights, lr=config.learning_rate)

    def to(self, device: torch.device) -> None:
        """Move the networks to a device, before the first gradient step."""
        self._networks.to(device)

    def choose(self, episodes: int) -> Choose:
        """Return how to act after a number of episodes: by the best action, but for a falling share of random ones."""
        return epsilon_greedy(epsilon_after(episodes, self.config))

    def learn(self, replay: ReplayBuffer, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that are due once there are enough new episodes, and at the end of the run."""
        new = new_episodes(self.config, replay.added, self._learned)
        if not new:
            return
        left = 1 - self._learned / self.config.episodes
        set_learning_rates(self._optimizer, (self.config.learning_rate,), left)
        self._learned = replay.added
        batch = replay.sample(new, rng, newest=new)
        with torch.no_grad(), evaluating(self._networks):
            unrolled = unroll(self.agents, batch)
            y, mask = td_targets(unrolled, unrolled, self.mixer, batch, self._returns)
        for rows in minibatches(new, self.config.n_epochs, self.config.batch_size, rng):
            part = batch.rows(rows)
            yield part, self.update(part, y[rows], mask[rows])

    def update(self, batch: Batch, y: torch.Tensor, mask: torch.Tensor) -> dict[str, float]:
        """Take one gradient step towards targets (B, T, M) and return the loss and what goes with it."""
        metrics = q_loss(unroll(self.agents, batch), self.mixer, batch, y, mask)
        metrics = add_grounding(metrics, self.agents, batch, self.config.grounding_coef)
        self.updates += 1
        return descend(metrics, self._optimizer, self.config.max_grad_norm, self._weights)

    def state(self) -> dict[str, Any]:
        """Return all that a learner needs to go on."""
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
