"""The settings that all training runs share, and how a field of settings says what values it takes.

An algorithm adds its own settings in a dataclass beside its learner, e.g. :mod:`chmarl_pb.learning.algorithms.mappo`.
A field is made by :func:`count`, :func:`natural`, :func:`amount`, :func:`share` or :func:`seed_number`, which carry its
limits; its description stands in the docstring. The command line is made from both.
"""

import math
from dataclasses import dataclass, field, fields
from typing import Any, ClassVar

import numpy as np

FROZEN = "frozen"  # key of a run's setting: sha256 of the frozen weights that pictures are encoded by, or nothing
TRAINED_IN = "trained_in"  # key of a run's setting: split, kind of task and the like; absent in older ones
OWN = "own_sha256"  # key in the last: what the user's own objects in options hold; absent where there are none
HOME = "home"  # the only home that was trained in, by name or path; absent where there were others
RULES = "rules"  # options of the environment by which a policy plays again; absent by the paper's rules
MEANING = "meaning"  # what actions and observations mean; only where an object of an option makes it another than RULES
CATALOG = "catalog_sha256"  # the same of a catalogue file and all that it names; absent without one
ROOMS = "rooms"  # those that actions and messages name, with a comma between; absent where they are the benchmark's


def count(default: int) -> Any:
    """Return a field for a number of things, at least 1."""
    return field(default=default, metadata={"limits": (1, math.inf)})


def natural(default: int) -> Any:
    """Return a field for a whole number that may be 0."""
    return field(default=default, metadata={"limits": (0, math.inf)})


def seed_number(default: int) -> Any:
    """Return a field for the seed of all random streams, a whole number of 32 bits."""
    return field(default=default, metadata={"limits": (0, 2**32 - 1)})


def amount(default: float | None) -> Any:
    """Return a field for a finite number, at least 0, or for none."""
    return field(default=default, metadata={"limits": (0, math.inf)})


def share(default: float) -> Any:
    """Return a field for a number from 0 to 1."""
    return field(default=default, metadata={"limits": (0, 1)})


def check(settings: Any) -> None:
    """Refuse settings, a frozen dataclass, with a value outside the limits of its field, or of another kind.

    Values become plain ones of the field's kind: 4.0 environments are 4, and NumPy's numbers Python's, which
    checkpoints can hold.

    Raises:
        ValueError: there is one; the message names the field and its limits.
    """
    for one in fields(settings):
        value = getattr(settings, one.name)
        if isinstance(value, np.generic):
            value = value.item()
        if "limits" in one.metadata and (value is not None or one.default is not None):
            value = _within(one.name, value, int if type(one.default) is int else float, *one.metadata["limits"])
        kind = type(one.default)
        if kind in _KINDS and not isinstance(value, kind):
            raise ValueError(f"{one.name}={value!r}: must be {_KINDS[kind]}")
        object.__setattr__(settings, one.name, value)


_KINDS = {bool: "True or False", str: "a text"}


def _within(name: str, value: Any, kind: type, least: float, most: float) -> Any:
    """Return a number as one of its kind.

    Raises:
        ValueError: it is outside its limits, or no such number.
    """
    if not hasattr(value, "__float__") or isinstance(value, bool):
        raise ValueError(f"{name}={value!r}: must be a number")
    if not (least <= value <= most and value < math.inf and (kind is float or value == int(value))):
        bounds = f"at least {least}, and finite" if most == math.inf else f"from {least} to {most}"
        raise ValueError(f"{name}={value}: must be {bounds}{', a whole number' * (kind is int)}")
    return kind(value)


@dataclass(frozen=True)
class RunConfig:
    """What fixes a training run of any algorithm, beside the environment.

    >>> from chmarl_pb.learning import Config
    >>> config = Config(episodes=100, hidden=32)
    >>> isinstance(config, RunConfig), config.hidden
    (True, 32)

    Attributes:
        seed: of every random stream but the noise of the loss of ``grounding_coef``, which is the same for every seed.
        episodes: to play in all, at least: whole rollouts are played.
        envs: environments played side by side; each rollout plays one episode in each.
        workers: processes that play a rollout, each with its share of the environments and random draws of its own.
        overlap: whether the gradient steps that follow a rollout are taken while the next is played, by the weights
            from before them, in ``workers`` processes beside the one that learns; not for learners on policy.
        horizon: most steps of an episode; `chmarl-pb train` takes them from ``--max-steps``.
        batch_size: episodes in a gradient step.
        learning_starts: episodes before the first gradient step; a shorter run learns after its last rollout alone.
        buffer_size: episodes in the replay buffer.
        memory_gib: bound of the replay buffer; it shortens ``buffer_size``.
        learning_rate: of Adam.
        max_grad_norm: largest norm of the gradient; 0 lets nothing be learned.
        reward_scale: factor of the rewards that are learned from.
        features: numbers that an observation is encoded to.
        hidden: units of each agent's GRU.
        layer_norm: whether an agent's features, and what its GRU gives, are normalised.
        encoder: of observations: a name in ``networks.encoders.ENCODERS``, or ``module:name``.
        image_encoder: of pictures, if there are any: "cnn" learns; all others are frozen, see ``networks.frozen``.
        graph_pool: of scene graphs: "mean" (the paper's), "gated" by the instruction, "grounded": by how likely each
            node is what the instruction calls X and Y, or "parsed": the same, as ``parse_instruction`` tells.
        word_vectors: whether words and classes come from static word vectors, so that unseen synonyms are understood.
        numbers_past: whether messages, the robot's own state and the goal also go past the encoder, to memory and head.
        cells_past: whether what pointing and guiding take also goes past the encoder: the cells of the picture in which
            X and Y can be taken, their directions from another robot, the room that is named; needs the grounded or the
            parsed pool.
        history_past: whether the most that each of these numbers, and of the agent's own actions, has been so far in
            the episode also goes past it.
        looks_past: whether the headings in which the robot has looked so far, as they are from its present one in its
            present room, also go past it, with the first of them and the share of each room's.
        grounding_coef: weight of the loss that teaches which classes the instruction calls X and Y; see
            :mod:`chmarl_pb.learning.networks.match`.
        home_rollouts: rollouts in a row that an environment stays in one of endless homes, at most as many as it says.
        validation_interval: episodes between two validations.
        checkpoint_interval: episodes between two checkpoints.
        log_interval: episodes between two rows of metrics.
    """

    #: Whether all kept episodes are learned from at once, so that memory has to hold them all.
    on_policy: ClassVar[bool] = False

    seed: int = seed_number(0)
    episodes: int = count(6_000)
    envs: int = count(8)
    workers: int = count(1)
    overlap: bool = False
    horizon: int = count(28)
    batch_size: int = count(32)
    learning_starts: int = natural(128)
    buffer_size: int = count(4_000)
    memory_gib: float = amount(2.0)
    learning_rate: float = amount(5e-4)
    max_grad_norm: float = amount(10.0)
    reward_scale: float = amount(1.0)
    features: int = count(128)
    hidden: int = count(128)
    layer_norm: bool = False
    encoder: str = "household"
    image_encoder: str = "cnn"
    graph_pool: str = "mean"
    word_vectors: bool = False
    numbers_past: bool = False
    cells_past: bool = False
    history_past: bool = False
    looks_past: bool = False
    grounding_coef: float = amount(0.0)
    home_rollouts: int = count(100)
    validation_interval: int = count(1_000)
    checkpoint_interval: int = count(1_000)
    log_interval: int = count(200)

    def __post_init__(self) -> None:
        """Refuse values outside the fields' limits, see :func:`check`, and what does not go together."""
        check(self)
        if self.overlap and self.on_policy:
            raise ValueError(
                "overlap=True: this algorithm learns from what its present weights have played; leave it out (an "
                "imitation that it begins with may have it)"
            )
        if self.workers > self.envs:
            raise ValueError(f"workers={self.workers}: must be at most envs={self.envs}, so that each plays an episode")

    @property
    def kept(self) -> int:
        """Most episodes that the replay buffer has to hold, if memory allows; on policy, those of whole rollouts."""
        if not self.on_policy:
            return self.buffer_size
        return -(-max(self.buffer_size, self.learning_starts) // self.envs) * self.envs

    @property
    def first_weights(self) -> str:
        """Path of a checkpoint whose agents' weights are begun with; "" for random ones."""
        return ""
