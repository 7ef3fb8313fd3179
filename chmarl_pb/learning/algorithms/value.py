"""Value factorisation (IQL, VDN, QMIX): networks, their targets, and one gradient step."""

import copy
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.gradient import add_grounding, descend
from chmarl_pb.learning.algorithms.losses import Returns, Unrolled, td_loss, unroll
from chmarl_pb.learning.algorithms.mixers import BY_MIXER, MIXERS, Mixer
from chmarl_pb.learning.algorithms.normalizer import Normalizer
from chmarl_pb.learning.config import RunConfig, count, natural, share
from chmarl_pb.learning.lookup import make_network
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.rollouts.batch import Batch
from chmarl_pb.learning.rollouts.collect import Choose, epsilon_after, epsilon_greedy
from chmarl_pb.learning.rollouts.replay_buffer import ReplayBuffer
from chmarl_pb.learning.spaces import LearnerInterface
from chmarl_pb.learning.storage.checkpoint import fill, fill_optimizer


@dataclass(frozen=True)
class Config(RunConfig):
    """Value factorisation; the defaults are PyMARL's settings, see ``docs/training.md`` for stronger ones.

    >>> config = Config(mixer="qmix-deep", gamma=0.95, episodes=500)
    >>> config.episodes
    500
    >>> Config(gamma=2.0)
    Traceback (most recent call last):
    ValueError: ...

    Attributes:
        mixer: of QMIX: a name in ``algorithms.mixers.MIXERS``, or ``module:name``; "" for its own. IQL, VDN and QTRAN
            take no other than their own.
        gradient_steps: after each rollout.
        gamma: discount of one step.
        exploration_initial_eps: share of random actions at first.
        exploration_final_eps: share of random actions in the end.
        exploration_fraction: share of the episodes over which epsilon falls linearly.
        td_lambda: how far targets look ahead: 0 one step, 1 to the end of the episode (Peng's Q(lambda)).
        target_update_interval: gradient steps after which the target networks are brought up to date.
        tau: share of the way that the target networks then go: 1 copies them.
        standardize_state: whether mixers see the state with mean 0 and deviation 1; those of IQL and VDN see none.
        standardize_rewards: whether rewards, the team's or, with IQL, each agent's, are learned from with mean 0 and
            deviation 1. Where agents can end an episode early this is another game: going on earns them nothing on
            average.
        normalize_values: whether networks give values with mean 0 and deviation 1, which a running scale makes real.
        embedding: hidden units of QMIX's mixer, or of one's own.
        joint_units: units of the joint networks of QTRAN.
    """

    mixer: str = ""
    gradient_steps: int = natural(4)
    gamma: float = share(0.97)
    td_lambda: float = share(0.0)
    exploration_initial_eps: float = share(1.0)
    exploration_final_eps: float = share(0.05)
    exploration_fraction: float = share(0.4)
    target_update_interval: int = count(200)
    tau: float = share(1.0)
    standardize_state: bool = False
    standardize_rewards: bool = False
    normalize_values: bool = False
    embedding: int = count(32)
    joint_units: int = count(64)


class ValueLearner:
    """Learns the agents' values, joined by a mixer.

    The defaults are PyMARL's where it has a like: targets of double Q that look one step ahead and are copied every 200
    gradient steps, states and values as they are. Unlike PyMARL's, agents share no weights, the optimizer is Adam and
    not RMSprop, several episodes are played side by side, and epsilon falls with the episodes; gamma is 0.97 (0.99
    there), the GRU has 128 units (64), the buffer 4,000 episodes (5,000), there is a gradient step for two episodes
    (one for each), and QTRAN's loss of other actions has the weight 1 (0.1). Sunehag et al. (VDN) have an LSTM, a
    dueling head and eligibility traces besides; Rashid et al. (QMIX) write the maximum of the target
    networks' own values, not double Q. Of IQL, Tan (1993) has tables, one for each agent, and Tampuu et al. (2017) DQN
    on pictures, without memory and double Q; here each agent has a recurrent network, and all learn from one replay
    buffer.

    Attributes:
        agents: agent -> its network.
        mixer: what joins the agents' values.
        updates: gradient steps that were taken.
    """

    def __init__(self, algorithm: str, interface: LearnerInterface, config: Config):
        """Make networks whose first weights depend on ``config.seed`` alone.

        Raises:
            ValueError: there is no such mixer or encoder.
        """
        self.algorithm, self.config = algorithm, config
        with torch.random.fork_rng(devices=[]):
            torch.manual_seed(config.seed)
            self.agents = make_agents(interface.observations, interface.actions, config)
            self.mixer = self.make_mixer(interface)
        self.networks = nn.ModuleDict({"agents": self.agents, "mixer": self.mixer})
        self._per_agent = bool(getattr(self.mixer, "per_agent", False))  # joint networks of one's own may not tell
        numbers = len(interface.agents) if self._per_agent else 1
        self._states = Normalizer(interface.state_size) if config.standardize_state else None
        self.returns = Returns(config.gamma, config.td_lambda, Normalizer(numbers) if config.normalize_values else None)
        self._rewards = Normalizer(numbers) if config.standardize_rewards else None
        scales = {"of_states": self._states, "of_values": self.returns.scale, "of_rewards": self._rewards}
        self._scales = nn.ModuleDict({name: scale for name, scale in scales.items() if scale is not None})
        self._targets = copy.deepcopy(self.networks).requires_grad_(False).eval()
        self._weights = [weight for weight in self.networks.parameters() if weight.requires_grad]
        self._optimizer = torch.optim.Adam(self._weights, lr=config.learning_rate, fused=True)
        self.updates = 0

    def make_mixer(self, interface: LearnerInterface) -> nn.Module:
        """Return what joins the agents' values.

        Raises:
            ValueError: the settings name a mixer that makes another algorithm of it, or there is none of this name; or
                they name none, and the algorithm has none of its own.
        """
        algorithm, mixer = self.algorithm, self.config.mixer or self.algorithm
        if mixer != algorithm and algorithm in MIXERS and (algorithm in BY_MIXER or mixer in BY_MIXER):
            instead = mixer if mixer in BY_MIXER else "qmix"
            raise ValueError(f"mixer={mixer!r}: that makes another algorithm of {algorithm}; use {instead}")
        if not self.config.mixer and algorithm not in MIXERS:
            raise ValueError(
                f"algorithm {algorithm} names no mixer; give mixer=..., one of: {', '.join(MIXERS)}; or module:name"
            )
        given = (len(interface.agents), interface.state_size, self.config.embedding)
        return make_network("mixer", mixer, MIXERS, *given, kind=Mixer)

    def to(self, device: torch.device) -> None:
        """Move the networks to a device, before the first gradient step."""
        for part in (self.networks, self._targets, self._scales):
            part.to(device)

    def choose(self, episodes: int) -> Choose:
        """Return how to act after a number of episodes: by the best action, but for a falling share of random ones."""
        return epsilon_greedy(epsilon_after(episodes, self.config))

    def learn(self, replay: ReplayBuffer, rng: np.random.Generator) -> Iterator[tuple[Batch, dict[str, float]]]:
        """Take the gradient steps that follow a rollout of episodes, and yield each batch with its figures."""
        if not self.updates:  # the networks may have been given weights since they were made
            self._targets.load_state_dict(self.networks.state_dict())
        for _ in range(self.config.gradient_steps):
            batch = replay.sample(self.config.batch_size, rng)
            yield batch, self.update(batch)

    def update(self, batch: Batch) -> dict[str, float]:
        """Take one gradient step and return the loss and what goes with it."""
        metrics = add_grounding(self.loss(batch), self.agents, batch, self.config.grounding_coef)
        figures = descend(metrics, self._optimizer, self.config.max_grad_norm, self._weights)
        self.updates += 1
        if self.updates % self.config.target_update_interval == 0:
            self._update_targets()
        return figures

    @torch.no_grad()
    def _update_targets(self) -> None:
        for target, weight in zip(self._targets.parameters(), self.networks.parameters(), strict=True):
            target.lerp_(weight, self.config.tau)
        for kept, counted in zip(self._targets.buffers(), self.networks.buffers(), strict=True):
            kept.copy_(counted)

    def loss(self, batch: Batch) -> dict[str, Tensor]:
        """Return the algorithm's loss of a batch, with what goes with it."""
        if self._states is not None:
            self._states.update(batch.states, batch.real.any(dim=-1, keepdim=True))
            batch = replace(batch, states=self._states.normalize(batch.states))
        if self._rewards is not None:
            batch = replace(batch, rewards=self._standardized(self._rewards, batch))
        online = unroll(self.agents, batch)
        with torch.no_grad():
            target = unroll(self._targets["agents"], batch)  # type: ignore[arg-type]
        return self.td_loss(online, target, self.mixer, self._targets["mixer"], batch)

    def _standardized(self, scale: Normalizer, batch: Batch) -> Tensor:
        """Return rewards (B, T, N) on a scale that takes them in: of each agent for IQL, else the team's one reward."""
        if self._per_agent:
            scale.update(batch.rewards, batch.acted)
            return scale.normalize(batch.rewards)
        reward, _, acts = batch.team()
        scale.update(reward, acts)
        return scale.normalize(reward).expand_as(batch.rewards)

    def td_loss(
        self, online: Unrolled, target: Unrolled, mixer: nn.Module, target_mixer: nn.Module, batch: Batch
    ) -> dict[str, Tensor]:
        """Return the loss from what the networks and their targets make of a batch."""
        return td_loss(online, target, mixer, target_mixer, batch, self.returns)  # type: ignore[arg-type]

    def state(self) -> dict[str, Any]:
        """Return all that a learner needs to go on."""
        return {
            "networks": self.networks.state_dict(),
            "targets": self._targets.state_dict(),
            "scales": self._scales.state_dict(),
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
        fill(self._scales, state.get("scales", {}), path)  # older checkpoints have none
        fill_optimizer(self._optimizer, state["optimizer"], path)
        self.updates = state["updates"]
