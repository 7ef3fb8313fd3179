"""The settings of a training run: what all algorithms share, and what each family adds."""

import math
from dataclasses import dataclass, fields
from typing import Any

FROZEN = "frozen"  # key of a run's setting: sha256 of the frozen weights that pictures are encoded by, or nothing

ALGORITHMS = ("iql", "vdn", "qmix", "qtran")

_FROM_ZERO = ("seed", "critic_starts", "learning_starts", "updates")  # whole numbers that may be 0
_SHARES = (
    "gamma", "gae_lambda", "epsilon_start", "epsilon_end", "exploration_fraction", "teacher_share", "dropout", "noise",
)  # fmt: skip


def check(settings: Any) -> None:
    """Refuse settings, a dataclass, that nothing can be made of.

    Raises:
        ValueError: a number of things is less than 1, a share not from 0 to 1, another number negative or infinite.
    """
    for field in fields(settings):
        value, kind = getattr(settings, field.name), type(field.default)
        if kind not in (int, float):
            continue
        least = 1 if kind is int and field.name not in _FROM_ZERO else 0
        most = 1 if field.name in _SHARES else math.inf
        if not least <= value <= most or value == math.inf or (kind is int and value != int(value)):
            bounds = f"from {least} to {most}" if most == 1 else f"at least {least}"
            raise ValueError(f"{field.name}={value}: must be {bounds}")


@dataclass(frozen=True)
class RunConfig:
    """What fixes a training run of any algorithm, beside the environment.

    Attributes:
        seed: of every random stream.
        episodes: to play in all.
        envs: environments played side by side; each wave plays one episode in each.
        horizon: most steps of an episode.
        batch_size: episodes in a gradient step.
        learning_starts: episodes before the first gradient step; a shorter run learns after its last wave alone.
        buffer_size: episodes in the replay buffer.
        memory_gib: bound of the replay buffer; it shortens ``buffer_size``.
        learning_rate: of Adam.
        gradient_clip: largest norm of the gradient.
        reward_scale: factor of the rewards that are learned from.
        features: numbers that an observation is encoded to.
        hidden: units of each agent's GRU.
        image_encoder: of pictures that are observed as such; see ``networks.build_encoder``.
        graph_pool: of scene graphs: "mean" (the paper's), or "gated" by the instruction.
        validation_interval: episodes between two validations.
        checkpoint_interval: episodes between two checkpoints.
        log_interval: episodes between two rows of metrics.
    """

    seed: int = 0
    episodes: int = 6_000
    envs: int = 8
    horizon: int = 28
    batch_size: int = 32
    learning_starts: int = 128
    buffer_size: int = 4_000
    memory_gib: float = 2.0
    learning_rate: float = 5e-4
    gradient_clip: float = 10.0
    reward_scale: float = 1.0
    features: int = 128
    hidden: int = 128
    image_encoder: str = "cnn"
    graph_pool: str = "mean"
    validation_interval: int = 1_000
    checkpoint_interval: int = 1_000
    log_interval: int = 200

    def __post_init__(self) -> None:
        """Refuse numbers that nothing can be made of; see :func:`check`."""
        check(self)

    @property
    def kept(self) -> int:
        """Most episodes that the replay buffer has to hold, if memory allows."""
        return self.buffer_size


@dataclass(frozen=True)
class Config(RunConfig):
    """Value factorisation.

    Attributes:
        updates: gradient steps after each wave.
        gamma: discount of one step.
        epsilon_start: share of random actions at first.
        epsilon_end: share of random actions in the end.
        exploration_fraction: share of the episodes over which epsilon falls linearly.
        target_update_interval: gradient steps after which the target networks are copied anew.
        embedding: units of the mixing network of QMIX.
        joint_units: units of the joint networks of QTRAN.
    """

    updates: int = 4
    gamma: float = 0.97
    epsilon_start: float = 1.0
    epsilon_end: float = 0.05
    exploration_fraction: float = 0.4
    target_update_interval: int = 200
    embedding: int = 32
    joint_units: int = 64

    def epsilon(self, episodes: int) -> float:
        """Return the share of random actions after a number of episodes."""
        progress = min(episodes / max(self.exploration_fraction * self.episodes, 1), 1.0)
        return self.epsilon_start + progress * (self.epsilon_end - self.epsilon_start)


@dataclass(frozen=True)
class ImitationConfig(RunConfig):
    """Imitation of a teacher that is asked in every state the learner comes to (DAgger, Ross et al. 2011).

    Attributes:
        updates: gradient steps after each wave.
        teacher_share: of the actions that the teacher takes at first; it falls linearly to 0 in the first half.
    """

    episodes: int = 3_000
    learning_rate: float = 1e-3
    graph_pool: str = "gated"
    updates: int = 4
    teacher_share: float = 1.0

    def share(self, episodes: int) -> float:
        """Return the share of actions that the teacher takes after a number of episodes."""
        return self.teacher_share * max(1 - 2 * episodes / self.episodes, 0.0)


@dataclass(frozen=True)
class MappoConfig(RunConfig):
    """MAPPO (Yu et al. 2022, https://arxiv.org/abs/2103.01955): an actor each, and a critic that knows the state.

    It learns from all episodes of the waves since it last did, as soon as they are ``buffer_size``, and at the end from
    the rest.

    Attributes:
        learning_starts: episodes that are learned from the first time, if they are more than ``buffer_size``.
        start: file of weights of agents to begin with (``best.pt``); "" for random ones.
        critic_starts: episodes that only the critic learns from at first, beside actors that begin with ``start``.
        epochs: passes over the episodes of a wave.
        gamma: discount of one step.
        gae_lambda: of generalised advantage estimation.
        clip: how far the ratio of probabilities may leave 1.
        entropy: weight of the policy's entropy.
        critic_units: units of the critic's layers.
        critic_rate: of Adam for the critic; both rates fall linearly, to 0 after the last gradient step.
    """

    episodes: int = 12_000
    batch_size: int = 32
    learning_starts: int = 0
    buffer_size: int = 128
    learning_rate: float = 5e-4
    gradient_clip: float = 1.0
    graph_pool: str = "gated"
    validation_interval: int = 2_000
    checkpoint_interval: int = 2_000
    start: str = ""
    critic_starts: int = 512
    epochs: int = 4
    gamma: float = 0.97
    gae_lambda: float = 0.95
    clip: float = 0.2
    entropy: float = 0.01
    critic_units: int = 128
    critic_rate: float = 1e-3

    @property
    def kept(self) -> int:
        """Most episodes that are learned from at once: whole waves, from ``buffer_size`` on."""
        return -(-max(self.buffer_size, self.learning_starts) // self.envs) * self.envs


#: Algorithm -> its settings.
CONFIGS: dict[str, type[RunConfig]] = {
    **dict.fromkeys(ALGORITHMS, Config),
    "imitation": ImitationConfig,
    "mappo": MappoConfig,
}
