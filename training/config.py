"""The settings of a learner of value factorisation, in one place."""

from dataclasses import dataclass

ALGORITHMS = ("iql", "vdn", "qmix", "qtran")


@dataclass(frozen=True)
class Config:
    """What fixes a training run, beside the environment and the algorithm.

    Attributes:
        seed: of every random stream.
        episodes: to play in all.
        envs: environments played side by side; each wave plays one episode in each.
        horizon: most steps of an episode.
        updates: gradient steps after each wave.
        batch_size: episodes in a gradient step.
        learning_starts: episodes before the first gradient step.
        buffer_size: episodes in the replay buffer.
        memory_gib: bound of the replay buffer; it shortens ``buffer_size``.
        learning_rate: of Adam.
        gradient_clip: largest norm of the gradient.
        gamma: discount of one step.
        reward_scale: factor of the rewards that are learned from.
        epsilon_start: share of random actions at first.
        epsilon_end: share of random actions in the end.
        exploration_fraction: share of the episodes over which epsilon falls linearly.
        target_update_interval: gradient steps after which the target networks are copied anew.
        features: numbers that an observation is encoded to.
        hidden: units of each agent's GRU.
        embedding: units of the mixing network of QMIX.
        joint_units: units of the joint networks of QTRAN.
        image_encoder: of pictures that are observed as such; see :func:`training.encoders.build_encoder`.
        validation_interval: episodes between two validations.
        checkpoint_interval: episodes between two checkpoints.
        log_interval: episodes between two rows of metrics.
    """

    seed: int = 0
    episodes: int = 6_000
    envs: int = 8
    horizon: int = 28
    updates: int = 4
    batch_size: int = 32
    learning_starts: int = 128
    buffer_size: int = 4_000
    memory_gib: float = 2.0
    learning_rate: float = 5e-4
    gradient_clip: float = 10.0
    gamma: float = 0.97
    reward_scale: float = 1.0
    epsilon_start: float = 1.0
    epsilon_end: float = 0.05
    exploration_fraction: float = 0.4
    target_update_interval: int = 200
    features: int = 128
    hidden: int = 128
    embedding: int = 32
    joint_units: int = 64
    image_encoder: str = "cnn"
    validation_interval: int = 1_000
    checkpoint_interval: int = 1_000
    log_interval: int = 200

    def epsilon(self, episodes: int) -> float:
        """Return the share of random actions after a number of episodes."""
        progress = min(episodes / max(self.exploration_fraction * self.episodes, 1), 1.0)
        return self.epsilon_start + progress * (self.epsilon_end - self.epsilon_start)
