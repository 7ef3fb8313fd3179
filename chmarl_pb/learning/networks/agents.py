"""The agents' networks: each agent has its own, and it sees nothing but its own history."""

from collections.abc import Mapping
from typing import Any, cast

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.learning.components import Counts, apart, of_each, one_hot
from chmarl_pb.learning.config import RunConfig
from chmarl_pb.learning.lookup import make_network
from chmarl_pb.learning.networks.encoders import ENCODERS, build_encoder, check_found
from chmarl_pb.learning.networks.looks import Looks
from chmarl_pb.learning.spaces import Tree, tree_map

NO_ACTION = -1  # last action at the first step


class Agent(nn.Module):
    """Values of one agent's actions from its history: encoder, last action, GRU, linear, as in Rashid et al. 2018.

    An action of several components has a head for each, see :mod:`chmarl_pb.learning.components`.

    Numbers that go past the encoder are read by the GRU and by the last layer. With ``history_past`` so is the most
    that each of them, and of the agent's own actions, has been so far in the episode: what has been heard, said, seen
    and tried, which a GRU would have to learn to keep. With ``looks_past`` so is where the agent has looked.

    Attributes:
        actions: their number, or that of the values of their components.
        past: numbers that go past the encoder.
        looks: remembers where the agent has looked; None: nothing does.
        state_size: numbers of the state that the agent keeps from step to step: the GRU's, history and looks.
    """

    def __init__(self, space: spaces.Space[Any], actions: Counts, config: RunConfig):
        """Make the layers for an observation space and a number of actions, or of the values of their components."""
        super().__init__()
        self.actions = actions
        given = (space, config.features, config.image_encoder, config.graph_pool)
        self.encoder = make_network("encoder", config.encoder, ENCODERS, *given, named=asked_of_encoder(config))
        if config.grounding_coef > 0 and not hasattr(self.encoder, "grounding_loss"):
            raise ValueError(
                f"grounding_coef={config.grounding_coef}: the encoder {type(self.encoder).__name__} has no "
                "grounding_loss(observation) by which it could be taught; leave it at 0"
            )
        self.past = int(getattr(self.encoder, "past", 0))
        outputs = sum(of_each(actions))
        self.looks = Looks(space) if config.looks_past else None
        history = self.past + outputs if config.history_past else 0
        told, looked = (self.looks.size, self.looks.state_size) if self.looks else (0, 0)
        self._kept = config.hidden, history, looked
        self.state_size = sum(self._kept)
        self._encoded = config.features + self.past
        read = self._encoded + history + told
        self.memory = nn.GRU(read + outputs, config.hidden, batch_first=True)
        self.head = nn.Linear(config.hidden + self.past + history + told, outputs)
        sizes = (read, config.hidden) if config.layer_norm else ()
        self.norms = nn.ModuleList(nn.LayerNorm(size) for size in sizes)

    def forward(
        self, observation: Tree, last_action: Tensor, hidden: Tensor | None = None, real: Tensor | None = None
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Return the values of the actions (B, T, K, A), the GRU's outputs (B, T, H), and the last state (1, B, S).

        Args:
            observation: tensors with the leading dimensions (B, T).
            last_action: (B, T, K) int64, the agent's own action of the step before, or ``NO_ACTION``.
            hidden: (1, B, S), the state before; zeros if None.
            real: (B, T) bool, which observations are more than padding; the others are not encoded. None: all are.
        """
        features = self._encode(observation, real).unflatten(0, last_action.shape[:2])
        acted = one_hot(last_action, self.actions).to(features.dtype)
        memory, most, looked = (None, None, None) if hidden is None else hidden.split(self._kept, dim=-1)
        numbers, told, kept = features[..., features.shape[-1] - self.past :], list[Tensor](), list[Tensor]()
        if self._kept[1]:
            history = _most_so_far(torch.cat([numbers, acted], dim=-1), most)
            told, kept = [history], [history]
        if self.looks:
            seen, looks = self.looks(cast(Mapping[str, Tensor], observation), None if looked is None else looked[0])
            told, kept = [*told, seen], [*kept, looks]
        if told:
            features, numbers = (torch.cat([part, *told], dim=-1) for part in (features, numbers))
        features = self.norms[0](features) if self.norms else features
        memory = None if memory is None else memory.contiguous()  # a part of the state, which cuDNN takes only so
        histories, state = self.memory(torch.cat([features, acted], dim=-1), memory)
        read = self.norms[1](histories) if self.norms else histories
        outputs = self.head(torch.cat([read, numbers], dim=-1))
        if kept:
            state = torch.cat([state, *(part[:, -1].unsqueeze(0) for part in kept)], dim=-1)
        return apart(outputs, self.actions), histories, state

    def _encode(self, observation: Tree, real: Tensor | None) -> Tensor:
        """Return features (B * T, F), zeros where there is only padding."""
        if real is None:
            return self._checked(self.encoder(observation))
        rows = real.flatten().nonzero().squeeze(1)
        encoded = self._checked(self.encoder(tree_map(lambda part: part.flatten(0, 1)[rows], observation)))
        return encoded.new_zeros(real.numel(), encoded.shape[1]).index_copy(0, rows, encoded)

    def _checked(self, encoded: Tensor) -> Tensor:
        """Return features with one leading dimension.

        Raises:
            ValueError: they are not as many as are wanted.
        """
        if encoded.dim() < 2 or encoded.shape[-1] != self._encoded:
            raise ValueError(
                f"the encoder {type(self.encoder).__name__} gives {tuple(encoded.shape)}; it is to give (..., "
                f"{self._encoded}) for observations with the dimensions (...) before their own"
            )
        return encoded.flatten(0, -2)


def _most_so_far(numbers: Tensor, before: Tensor | None) -> Tensor:
    """Return the most that numbers (B, T, F) have been up to each step, and before, (1, B, F), from 0 on."""
    most = numbers.cummax(dim=1).values
    return most.clamp(min=0) if before is None else torch.maximum(most, before[0].unsqueeze(1))


def asked_of_encoder(config: Any) -> dict[str, bool]:
    """Return the options that settings switch on; encoders of one's own need not know of the others."""
    options = {
        "word_vectors": config.word_vectors, "numbers_past": config.numbers_past, "taught": config.grounding_coef > 0,
        "cells_past": getattr(config, "cells_past", False),  # clones know no actions that point
    }  # fmt: skip
    return {name: True for name, is_on in options.items() if is_on}


def make_agents(
    observations: dict[str, spaces.Space[Any]], actions: Mapping[str, Counts], config: RunConfig
) -> nn.ModuleDict:
    """Return agent -> its network, from its observation space and its number of actions.

    Raises:
        ValueError: there is no such encoder, or an option is about what no agent observes.
    """
    agents = {name: Agent(space, actions[name], config) for name, space in observations.items()}
    if ENCODERS.get(config.encoder) is build_encoder:
        check_found((agent.encoder for agent in agents.values()), asked_of_encoder(config))
    return nn.ModuleDict(agents)


def device_of(networks: nn.Module) -> torch.device:
    """Return the device that the weights of networks are on; the CPU if they have none."""
    return next((weight.device for weight in networks.parameters()), torch.device("cpu"))


class RecurrentActors:
    """Lets agents act in several episodes side by side, step by step; remembers their histories."""

    def __init__(self, agents: nn.ModuleDict, episodes: int):
        """Begin a number of episodes."""
        self.agents, self._device = agents, device_of(agents)
        with self._device:
            self._hidden = {
                name: torch.zeros(episodes, cast(Agent, agent).state_size) for name, agent in agents.items()
            }
            counts = {name: of_each(cast(Agent, agent).actions) for name, agent in agents.items()}
            self._last = {name: torch.full((episodes, len(sizes)), NO_ACTION) for name, sizes in counts.items()}

    @torch.no_grad()
    def values(self, name: str, episodes: Tensor, observation: Tree) -> Tensor:
        """Return an agent's values (B, K, A) in some of the episodes.

        Args:
            name: of the agent.
            episodes: (B) numbers of the episodes.
            observation: tensors with the leading dimension B.
        """
        one_step = tree_map(lambda part: part.unsqueeze(1).to(self._device), observation)
        before = self._hidden[name][episodes].unsqueeze(0)
        values, _, after = self.agents[name](one_step, self._last[name][episodes].unsqueeze(1), before)
        self._hidden[name][episodes] = after[0]
        q_values: Tensor = values[:, 0].cpu()
        return q_values

    def remember(self, name: str, episodes: Tensor, actions: Tensor) -> None:
        """Note the actions (B, K) that an agent takes in some of the episodes."""
        self._last[name][episodes] = actions.to(self._device)
