"""Cloned robots: their settings, their networks, and the policy that drives an environment by them."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast, get_args

import torch
from gymnasium import spaces
from torch import Tensor, nn

from chmarl_pb.envs.joint import joined
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning.components import one_hot
from chmarl_pb.learning.config import CATALOG, FROZEN, amount, check, count, seed_number, share
from chmarl_pb.learning.networks import DictEncoder, build_encoder
from chmarl_pb.learning.networks.agents import NO_ACTION, asked_of_encoder, device_of
from chmarl_pb.learning.networks.encoders import check_found
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS, FrozenEncoder, frozen_encoder, trained_with
from chmarl_pb.learning.networks.kept_features import all_with_features, feature_space
from chmarl_pb.learning.observation_keys import named
from chmarl_pb.learning.policies.checks import check_names, check_rules, check_size
from chmarl_pb.learning.policies.own_code import own_code
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.spaces import stack, tensors
from chmarl_pb.learning.storage import checkpoint
from chmarl_pb.learning.threads import threads
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.robots.registry import TEAM

KIND = "bc"  # of checkpoints
DataSplit = Literal["train", "train-limited"]  # that data sets are made of
IMAGE_SIZE = 128  # pixels of the pictures in data sets


@dataclass(frozen=True)
class CloningConfig:
    """What fixes a run of cloning, beside the data.

    >>> CloningConfig(observation="visual", epochs=5).epochs
    5

    Attributes:
        observation: "scene_graph" or "visual".
        centralized: whether one network sees and drives all robots.
        messages: whether the robots hear each other.
        feedback: whether the robots get language feedback.
        split: whose episodes are learned from; see ``chmarl-pb dataset generate``.
        noise: share of random actions in the data set.
        seed: of weights, order and dropout.
        epochs: passes over the data.
        batch_size: episodes in a batch.
        learning_rate: of AdamW at the start; it falls to zero along a cosine.
        weight_decay: of AdamW.
        dropout: share of features, and of the numbers that go past the encoder, that are left out in training.
        features: length of an encoded observation.
        hidden: length of the GRU's state.
        past_actions: whether a robot observes its own last action.
        image_encoder: of pictures.
        graph_pool: of scene graphs: "mean" (the paper's), "gated", "grounded" or "parsed".
        word_vectors: whether words and classes come from static word vectors, so that unseen synonyms are understood.
        numbers_past: whether the messages and the robots' own states also go past the encoder, to memory and heads.
        grounding_coef: weight of the loss that teaches which classes the instruction calls X and Y.
        temperature: of the probabilities that actions are drawn from in an episode; 0: the likeliest action.
        validation_interval: epochs between two choices of the best weights.
        validation_tasks: of each validation split that are played then, at equal distances.
        robots: those of the data set, with commas between them.
    """

    observation: str = "scene_graph"
    centralized: bool = False
    messages: bool = True
    feedback: bool = True
    split: DataSplit = "train"
    noise: float = share(0.0)
    seed: int = seed_number(0)
    epochs: int = count(10)
    batch_size: int = count(16)
    learning_rate: float = amount(2e-3)
    weight_decay: float = amount(1e-4)
    dropout: float = share(0.0)
    features: int = count(128)
    hidden: int = count(128)
    past_actions: bool = True
    image_encoder: str = "resnet18"
    graph_pool: str = "mean"
    word_vectors: bool = False
    numbers_past: bool = False
    grounding_coef: float = amount(0.0)
    temperature: float = amount(0.0)
    validation_interval: int = count(2)
    validation_tasks: int = count(50)
    robots: str = ",".join(TEAM)

    def __post_init__(self) -> None:
        """Refuse values outside the fields' limits, see :func:`chmarl_pb.learning.config.check`, and other splits."""
        check(self)
        if self.split not in get_args(DataSplit):
            raise ValueError(f"split={self.split!r}: data sets are of {' or '.join(get_args(DataSplit))}")

    @property
    def left_out(self) -> tuple[str, ...]:
        """Names of the keys that the networks do not see."""
        return tuple(key for key in ("messages", "feedback") if not getattr(self, key))

    @property
    def uses_features(self) -> bool:
        """Whether pictures are encoded before they reach the networks, by frozen weights."""
        return self.observation == "visual" and self.image_encoder in FROZEN_ENCODERS

    def groups(self, robots: Sequence[str]) -> list[list[str]]:
        """Return the robots that each network drives."""
        return [list(robots)] if self.centralized else [[name] for name in robots]


class BCActor(nn.Module):
    """One network that drives one robot or all: encoder, last actions -> GRU -> a head for each robot."""

    def __init__(self, space: spaces.Dict, actions: tuple[int, ...], config: CloningConfig):
        """Make the layers for an observation space and each robot's number of actions."""
        super().__init__()
        self.actions = actions
        self.encoder = cast(
            DictEncoder,
            build_encoder(space, config.features, config.image_encoder, config.graph_pool, **asked_of_encoder(config)),
        )
        check_found([self.encoder], asked_of_encoder(config))
        past = self.encoder.past
        self.dropout = nn.Dropout(config.dropout)
        self.past_actions = config.past_actions
        self.memory = nn.GRU(config.features + past + sum(actions) * self.past_actions, config.hidden, batch_first=True)
        self.heads = nn.ModuleList(nn.Linear(config.hidden + past, count) for count in actions)

    def forward(
        self, observation: dict[str, Tensor], last: Tensor, hidden: Tensor | None = None
    ) -> tuple[list[Tensor], Tensor]:
        """Return logits (B, T, A) of each robot's actions and the GRU's last state (1, B, H).

        Args:
            observation: tensors with the leading dimensions (B, T).
            last: (B, T, robots) last actions, or ``NO_ACTION``.
            hidden: (1, B, H), the GRU's state before; zeros if None.
        """
        features = self.dropout(self.encoder(observation)).unflatten(0, last.shape[:2])
        numbers = features[..., features.shape[-1] - self.encoder.past :]
        if self.past_actions:
            features = torch.cat([features, one_hot(last, self.actions).to(features.dtype)], dim=-1)
        histories, hidden = self.memory(features, hidden)
        histories = torch.cat([self.dropout(histories), numbers], dim=-1)
        return [head(histories) for head in self.heads], hidden


def make_actors(env: HouseholdEnv, config: CloningConfig, encoder: FrozenEncoder | None) -> nn.ModuleList:
    """Return the networks of all robots of an environment, with random weights.

    Args:
        env: the environment.
        config: settings.
        encoder: what encodes pictures before they reach the networks, see :func:`encoder_of`.
    """
    space = spaces.Dict(joined({name: env.observation_space(name).spaces for name in env.possible_agents}))
    if encoder is not None:
        space = feature_space(space, encoder)
    actions = {name: len(names) for name, names in env.action_names.items()}
    actors = []
    for group in config.groups(env.possible_agents):
        own = {f"{name}_{key}" for name in group for key in env.observation_space(name).spaces}
        keys = [key for key in space.spaces if key in own.difference(named(space.spaces, *config.left_out))]
        actors.append(
            BCActor(spaces.Dict({key: space[key] for key in keys}), tuple(actions[name] for name in group), config)
        )
    return nn.ModuleList(actors)


class BCPolicy:
    """Drives the robots by cloned networks, in several episodes at once."""

    def __init__(
        self, actors: nn.ModuleList, config: CloningConfig, robots: Sequence[str], encoder: FrozenEncoder | None
    ):
        """Take the networks of robots over, and what encodes pictures for them.

        They must not be trained while an episode is played.
        """
        self.actors, self.config, self.robots, self._encoder = actors, config, robots, encoder

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed; each draws from a stream of its own."""
        self._device = device_of(self.actors)
        self._hidden = [torch.zeros(1, len(seeds), self.config.hidden, device=self._device) for _ in self.actors]
        self._last = {name: torch.full((len(seeds),), NO_ACTION) for name in self.robots}
        self._streams = [torch.Generator().manual_seed(seed or 0) for seed in seeds]

    @threads(1)
    @torch.no_grad()
    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return an action of each robot, drawn from its network's probabilities or the likeliest one."""
        index = torch.tensor(episodes)
        if self._encoder is not None:
            observations = all_with_features(observations, self._encoder)
        batch = stack([joined(one) for one in observations])
        steps = {key: part.unsqueeze(1).to(self._device) for key, part in tensors(batch).items()}
        robots = list(observations[0])  # all, or those of one network
        for number, (group, actor) in enumerate(zip(self.config.groups(self.robots), self.actors, strict=True)):
            if not set(group) <= set(robots):
                continue
            last = torch.stack([self._last[name][index] for name in group], dim=-1).unsqueeze(1)
            logits, after = actor(steps, last.to(self._device), self._hidden[number][:, index])
            self._hidden[number][:, index] = after
            for name, values in zip(group, logits, strict=True):
                self._last[name][index] = self._choice(values[:, 0].cpu(), episodes)
        return [{name: int(self._last[name][number]) for name in robots} for number in episodes]

    def _choice(self, logits: Tensor, episodes: Sequence[int]) -> Tensor:
        """Return the actions (B) from logits (B, A) in the episodes with these numbers."""
        if self.config.temperature == 0:
            return logits.argmax(dim=1)
        probabilities = torch.softmax(logits / self.config.temperature, dim=1)
        draws = zip(probabilities, episodes, strict=True)
        return torch.cat([torch.multinomial(row, 1, generator=self._streams[number]) for row, number in draws])


class BCPolicies:
    """Makes the policies of a checkpoint of clones; can be sent to other processes."""

    def __init__(self, path: Path):
        """Read the settings of a checkpoint.

        Raises:
            CheckpointError: it is missing, damaged or of another kind.
        """
        self.path = path
        with checkpoint.reading(path):
            self.config = CloningConfig(**checkpoint.load(path, KIND)["config"])
        self._named = {name: getattr(self.config, name) for name in ("graph_pool", "image_encoder")}
        self.deterministic, self.centralized = self.config.temperature == 0, self.config.centralized

    @property
    def code(self) -> tuple[Any, ...]:
        """The user's own code that plays by these weights, see :func:`own_code`."""
        return own_code(self._named, self.path)

    def __call__(self, env: HouseholdEnv) -> Policy:
        """Return the policy for an environment.

        Raises:
            CheckpointError: the checkpoint was trained with other observations.
        """
        with checkpoint.reading(self.path):
            return self._policy(env, checkpoint.load(self.path, KIND))

    def _policy(self, env: HouseholdEnv, content: dict[str, Any]) -> Policy:
        check_size(env, {"image_size": IMAGE_SIZE}, self.path)
        if CATALOG in content:  # older ones do not say
            check_names(env, content, self.path)
        check_rules(env, {}, self.path)  # data sets are of the paper's rules
        config, encoder = self.config, None
        if config.uses_features:
            encoder = trained_with(config.image_encoder, content[FROZEN], self.path)
        actors = make_actors(env, config, encoder)
        checkpoint.fill(actors, content["actors"], self.path)
        return BatchOfOne(BCPolicy(actors.requires_grad_(False).eval(), config, env.possible_agents, encoder))


def encoder_of(config: CloningConfig) -> FrozenEncoder | None:
    """Return what encodes pictures before they reach the networks of a new run; None: nothing does."""
    return frozen_encoder(config.image_encoder) if config.uses_features else None


def weights_of(config: CloningConfig) -> str:
    """Return the fingerprint of the frozen weights that a new run uses, or nothing."""
    encoder = encoder_of(config)
    return encoder.fingerprint if encoder is not None else ""
