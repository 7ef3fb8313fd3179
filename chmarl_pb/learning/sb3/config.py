"""The settings of a run of Stable-Baselines3, in one place."""

import math
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
import tyro
from gymnasium import spaces
from sb3_contrib import QRDQN, RecurrentPPO
from stable_baselines3 import A2C, DQN, PPO
from stable_baselines3.common.base_class import BaseAlgorithm

from chmarl_pb.envs.joint import PARTNERS
from chmarl_pb.envs.registration import options_of
from chmarl_pb.envs.tracks import PAPER, TRACKS
from chmarl_pb.learning.config import CATALOG, ROOMS, amount, check, count, seed_number
from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.networks.encoders import GRAPH_POOLS
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.observation_keys import GOAL, MESSAGES, SELF
from chmarl_pb.learning.sb3.features import GoalFeatures, HouseholdFeatures
from chmarl_pb.robots.registry import TEAM, listed

_MEMORY = 2 * 2**30  # bytes of DQN's replay buffer, at most

EnvId = Literal[
    "CHMARL/SceneGraph-v0", "CHMARL/Visual-v0", "CHMARL/SceneGraphHumanoid-v0", "CHMARL/VisualHumanoid-v0",
    "CHMARL/SceneGraphHumanoid-v1", "CHMARL/VisualHumanoid-v1", "CHMARL/GroundedSceneGraph-v0",
    "CHMARL/GroundedVisual-v0", "CHMARL/GroundedSceneGraphHumanoid-v0", "CHMARL/GroundedVisualHumanoid-v0",
]  # fmt: skip
AlgorithmName = Literal["ppo", "a2c", "dqn", "qr-dqn", "recurrent-ppo"]
PresetName = Literal["goal", "goal-encoder", "encoder"]
Hidden = tyro.conf.Suppress[tyro.conf.Fixed[str]]  # of the command line, which finds it from other options


@dataclass(frozen=True)
class Algorithm:
    """An algorithm of SB3.

    Attributes:
        model: its class.
        policy: name of its policy.
        network: what the policy's network has beside the features extractor.
        replays: whether it learns values from a replay buffer: it takes single numbers as actions, and plays its best.
    """

    model: type[BaseAlgorithm]
    policy: str
    network: dict[str, Any]
    replays: bool = False


_HEADS = {"net_arch": {"pi": [64], "vf": [64]}}

ALGORITHMS = {
    "ppo": Algorithm(PPO, "MultiInputPolicy", _HEADS),
    "a2c": Algorithm(A2C, "MultiInputPolicy", _HEADS),
    "dqn": Algorithm(DQN, "MultiInputPolicy", {"net_arch": [64]}, replays=True),
    "qr-dqn": Algorithm(QRDQN, "MultiInputPolicy", {"net_arch": [64], "n_quantiles": 50}, replays=True),
    "recurrent-ppo": Algorithm(
        RecurrentPPO, "MultiInputLstmPolicy", {**_HEADS, "lstm_hidden_size": 128, "enable_critic_lstm": True}
    ),
}

Settings = dict[str, dict[str, Any]]


@dataclass(frozen=True)
class Preset:
    """What a network reads of an observation, and how it learns.

    Attributes:
        goal: whether the goal is observed.
        encoded: whether graphs, words and pictures are encoded.
        reward_scale: factor of the rewards that are learned from.
        settings: algorithm -> what differs from its defaults.
    """

    goal: bool
    encoded: bool
    reward_scale: float
    settings: Settings


_ON_POLICY = {"gamma": 0.97, "gae_lambda": 0.95, "ent_coef": 0.01, "learning_rate": 5e-4}
_DQN = {
    "gamma": 0.97, "learning_rate": 3e-4, "batch_size": 64, "train_freq": 1, "gradient_steps": 2,
    "learning_starts": 2_000, "target_update_interval": 2_000, "exploration_fraction": 0.4,
}  # fmt: skip

#: Small careful steps on unscaled rewards.
_CAREFUL: Settings = {
    "ppo": {**_ON_POLICY, "n_steps": 64, "batch_size": 128, "n_epochs": 4},
    "a2c": {**_ON_POLICY, "n_steps": 16},
    "dqn": _DQN,
    "qr-dqn": _DQN,
    "recurrent-ppo": {**_ON_POLICY, "n_steps": 64, "batch_size": 128, "n_epochs": 4},
}
_BOLD_PPO = {**_ON_POLICY, "ent_coef": 0.015, "learning_rate": 7e-4, "n_steps": 64, "batch_size": 128, "n_epochs": 10}
_BOLD_DQN = {**_DQN, "learning_rate": 5e-4, "batch_size": 128, "gradient_steps": 4}
#: More of every step on scaled rewards, as few numbers allow.
_BOLD: Settings = {
    "ppo": _BOLD_PPO,
    "a2c": {**_ON_POLICY, "ent_coef": 0.015, "learning_rate": 1e-3, "n_steps": 16},
    "dqn": _BOLD_DQN,
    "qr-dqn": _BOLD_DQN,
    "recurrent-ppo": {**_BOLD_PPO, "n_epochs": 5},
}

PRESETS = {
    "goal": Preset(goal=True, encoded=False, reward_scale=0.2, settings=_BOLD),
    "goal-encoder": Preset(goal=True, encoded=True, reward_scale=0.2, settings=_BOLD),
    "encoder": Preset(goal=False, encoded=True, reward_scale=1.0, settings=_CAREFUL),
}

#: Settings of runs that were written before there was a choice.
BEFORE_PRESETS = {
    "preset": "encoder", "robots": ",".join(TEAM), "home": None, "catalog": None, CATALOG: "", ROOMS: "",
    "word_vectors": False,
}  # fmt: skip


@dataclass(frozen=True)
class Config:
    """What fixes the numbers of a run.

    >>> config = Config("ppo", "CHMARL/SceneGraphHumanoid-v0", preset="encoder", steps=10_000)
    >>> config.alone
    True

    Attributes:
        algo: "ppo", "a2c", "dqn", "qr-dqn" or "recurrent-ppo".
        env_id: a Gymnasium id of the benchmark; it names the policy of the drone, too, where the humanoid learns alone.
        preset: what the network reads, and how it learns. "goal": the few numbers of ``messages``, ``self``, ``goal``
            alone, so that ``features``, ``graph_pool`` and ``word_vectors`` are of no use, and pictures are not seen;
            "goal-encoder": the encoder's features, too; "encoder": these alone, without the goal.
        steps: of the environments in all.
        seed: of every random stream.
        envs: environments played side by side.
        messages: whether the robots hear each other.
        feedback: whether they get language feedback, where the track has any.
        image_size: pixels.
        image_encoder: "cnn" learns from pictures; others are frozen, see :mod:`chmarl_pb.learning.networks.frozen`.
        frozen: sha256 of the frozen weights, which ``run`` finds out; empty without them.
        features: numbers that an observation is encoded to.
        graph_pool: of scene graphs; see :func:`chmarl_pb.learning.networks.encoders.build_encoder`.
        word_vectors: whether words and classes come from static word vectors, so that unseen synonyms are understood.
        learning_rate: of the optimizer; None: that of the algorithm.
        interval: steps between two validations, each with a checkpoint.
        tasks: number of validation tasks of each split that weights are chosen on, two in the paper's track, one in the
            grounded; for a home as many are drawn as of all of them.
        max_steps: of an episode.
        robots: with commas between them; see :class:`chmarl_pb.envs.options.Options`.
        home: name or path of a home to train in instead of the split's.
        catalog: catalogue file of own things.
        catalog_sha256: of that file and all that it names, which ``run`` finds out; empty without it.
        rooms: that actions and messages name, which ``run`` finds out, too; empty where they are the benchmark's.
    """

    algo: AlgorithmName
    env_id: Hidden = "CHMARL/SceneGraph-v0"
    preset: PresetName = "goal"
    steps: int = count(600_000)
    seed: int = seed_number(0)
    envs: int = count(16)
    messages: bool = True
    feedback: bool = True
    image_size: int = count(128)
    image_encoder: str = "cnn"
    frozen: Hidden = ""
    features: int = count(128)
    graph_pool: str = "gated"
    word_vectors: bool = False
    learning_rate: float | None = amount(None)
    interval: int = count(25_000)
    tasks: int = count(50)
    max_steps: int = count(28)
    robots: str = ",".join(TEAM)
    home: str | None = None
    catalog: str | None = None
    catalog_sha256: Hidden = ""
    rooms: Hidden = ""

    def __post_init__(self) -> None:
        """Refuse values outside the fields' limits, unknown names, and actions that an algorithm cannot choose."""
        check(self)
        if self.algo not in ALGORITHMS:
            raise ValueError(f"algo={self.algo!r} is not known; use one of: {', '.join(ALGORITHMS)}")
        options_of(self.env_id)
        if self.replays and self.track != PAPER:
            raise ValueError(f"{self.algo} chooses single numbers, no symbols beside them; use a2c, ppo, recurrent-ppo")
        if self.preset not in PRESETS:
            raise ValueError(f"preset={self.preset!r} is not known; use one of: {', '.join(PRESETS)}")
        look_up("graph_pool", self.graph_pool, GRAPH_POOLS)
        look_up("image_encoder", self.image_encoder, {**IMAGE_ENCODERS, **FROZEN_ENCODERS})
        if self.image_encoder != "cnn" and self.keys:
            raise ValueError(
                f"image_encoder={self.image_encoder!r}: preset {self.preset!r} looks at no picture; "
                "use goal-encoder or encoder"
            )

    @property
    def alone(self) -> bool:
        """Whether the first robot that grasps is the only learner."""
        return "Humanoid" in self.env_id

    @property
    def sampled(self) -> bool:
        """Whether actions are drawn when a trained policy plays; without memory, the likeliest repeats its failures."""
        return not self.replays

    @property
    def replays(self) -> bool:
        """Whether the algorithm learns values from a replay buffer."""
        return ALGORITHMS[self.algo].replays

    @property
    def track(self) -> str:
        """Name of the track."""
        return str(options_of(self.env_id)["track"])

    @property
    def partner(self) -> str:
        """Policy of the robots that do not learn, if one learns alone."""
        return str(options_of(self.env_id).get("partner", PARTNERS[0]))

    @property
    def observation(self) -> str:
        """The benchmark's name of what is observed."""
        return str(options_of(self.env_id)["observation"])

    @property
    def env_options(self) -> dict[str, Any]:
        """Keyword arguments of the environments; some algorithms know single numbers as actions only."""
        shared = {name: asdict(self)[name] for name in ("messages", "feedback", "image_size", "max_steps")}
        shared |= {name: shared[name] and TRACKS[self.track][name] for name in ("messages", "feedback")}
        if PRESETS[self.preset].goal:
            shared["goal"] = True
        if listed(self.robots) != TEAM:
            shared["robots"] = listed(self.robots)
        shared |= {name: value for name in ("home", "catalog") if (value := getattr(self, name)) is not None}
        return shared | ({"flat_actions": True} if self.replays and not self.alone else {})

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the keys that the network reads; none: all."""
        return () if PRESETS[self.preset].encoded else (GOAL, MESSAGES, SELF)

    @property
    def policy_kwargs(self) -> dict[str, Any]:
        """Keyword arguments of the policy's network."""
        network = {**ALGORITHMS[self.algo].network, "normalize_images": False}
        if not PRESETS[self.preset].encoded:
            return {**network, "features_extractor_class": GoalFeatures}
        encoder: dict[str, Any] = {"features_dim": self.features, "graph_pool": self.graph_pool}
        if PRESETS[self.preset].goal:
            encoder["numbers_past"] = True
        if self.word_vectors:
            encoder["word_vectors"] = True
        if self.frozen:
            encoder["image_encoder"] = self.image_encoder
        return {**network, "features_extractor_class": HouseholdFeatures, "features_extractor_kwargs": encoder}

    def settings(self, space: spaces.Space[Any]) -> dict[str, Any]:
        """Return the algorithm's keyword arguments for an observation space."""
        settings = dict(PRESETS[self.preset].settings[self.algo])
        if self.learning_rate is not None:
            settings["learning_rate"] = self.learning_rate
        if self.replays:
            settings["buffer_size"] = min(50_000, self.steps, _MEMORY // (2 * _size(space)))  # before and after a step
        return settings


def _size(space: spaces.Space[Any]) -> int:
    """Return the bytes of an observation."""
    parts = list(space.spaces.values()) if isinstance(space, spaces.Dict) else [space]
    return sum(math.prod(part.shape or ()) * np.dtype(part.dtype).itemsize for part in parts)
