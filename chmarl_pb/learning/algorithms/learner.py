"""The learner of value factorisation: networks, their targets, and one gradient step."""

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.losses import Batch, qtran_loss, td_loss, unroll
from chmarl_pb.learning.algorithms.mixers import QtranNetworks, make_mixer
from chmarl_pb.learning.config import Config
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.runs.checkpoint import fill, fill_optimizer
from chmarl_pb.learning.runs.collect import Choose, epsilon_greedy
from chmarl_pb.learning.runs.replay_buffer import Replay
from chmarl_pb.learning.spaces import Interface


class Learner:
    """Learns the agents' values by one of the algorithms.

    Attributes:
        agents: agent -> its network.
        updates: gradient steps that were taken.
    """

    def __init__(self, algorithm: str, interface: Interface, config: Config):
        """Make networks whose first weights depend on ``config.seed`` alone.

        Raises:
            ValueError: there is no such algorithm.
        """
        self.algorithm, self.config = algorithm, config
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.agents = make_agents(interface.observations, interface.actions, config)
            self.mixer = make_mixer(algorithm, interface, config)
        self.networks = nn.ModuleDict({"agents": self.agents, "mixer": self.mixer})
        self._targets = copy.deepcopy(self.networks).requires_grad_(False)
        self._weights = [weight for weight in self.networks.parameters() if weight.requires_grad]
        self._optimizer = torch.optim.Adam(self._weights, lr=config.learning_rate, fused=True)
        self.updates = 0

    def choose(self, episodes: int) -> Choose:
        """Return how to act after a number of episodes: by the best action, but for a falling share of random ones."""
        return epsilon_greedy(self.config.epsilon(episodes))

    def learn(self, replay: Replay, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that follow a wave of episodes, and yield each batch with its figures."""
        for _ in range(self.config.updates):
            batch = replay.sample(self.config.batch_size, rng)
            yield batch, self.update(batch)

    def update(self, batch: Batch) -> dict[str, float]:
        """Take one gradient step and return the loss and what goes with it."""
        metrics = self.loss(batch)
        self._optimizer.zero_grad()
        metrics["loss"].backward()
        norm = nn.utils.clip_grad_norm_(self._weights, self.config.gradient_clip)
        self._optimizer.step()
        self.updates += 1
        if self.updates % self.config.target_update_interval == 0:
            self._targets.load_state_dict(self.networks.state_dict())
        return {name: float(value.detach()) for name, value in metrics.items()} | {"gradient_norm": float(norm)}

    def loss(self, batch: Batch) -> dict[str, Tensor]:
        """Return the algorithm's loss of a batch, with what goes with it."""
        online = unroll(self.agents, batch)
        with torch.no_grad():
            target = unroll(self._agents_of(self._targets), batch)
        mixers = self.mixer, self._targets["mixer"]
        if isinstance(self.mixer, QtranNetworks):
            return qtran_loss(online, target, *mixers, batch, self.config.gamma)  # type: ignore[arg-type]
        return td_loss(online, target, *mixers, batch, self.config.gamma)

    def state(self) -> dict[str, Any]:
        """Return all that a learner needs to go on."""
        return {
            "networks": self.networks.state_dict(),
            "targets": self._targets.state_dict(),
            "optimizer": self._optimizer.state_dict(),
            "updates": self.updates,
        }

    def restore(self, state: dict[str, Any], path: Path) -> None:
        """Go on from a state.

        Args:
            state: made by ``state``.
            path: of the file that it comes from, for the error.

        Raises:
            CheckpointError: it is of another architecture.
        """
        fill(self.networks, state["networks"], path)
        fill(self._targets, state["targets"], path)
        fill_optimizer(self._optimizer, state["optimizer"], path)
        self.updates = state["updates"]

    @staticmethod
    def _agents_of(networks: nn.ModuleDict) -> nn.ModuleDict:
        agents = networks["agents"]
        assert isinstance(agents, nn.ModuleDict)
        return agents
