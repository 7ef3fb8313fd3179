"""``best.zip`` of a run: a model of Stable-Baselines3 with our settings beside it, and the policy made from it."""

import json
import math
import zipfile
from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.error import ClosedEnvironmentError
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.vec_env import VecTransposeImage

from chmarl_pb.envs.joint import PARTNERS
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.errors import OptionError
from chmarl_pb.files import replacing
from chmarl_pb.learning.networks.frozen import FrozenEncoder, frozen_encoder, trained_with
from chmarl_pb.learning.networks.kept_features import feature_space
from chmarl_pb.learning.observation_keys import GOAL, IMAGE, named
from chmarl_pb.learning.policies.batched import BatchOfOne
from chmarl_pb.learning.policies.checks import check_catalog, check_rules, check_size, silenced
from chmarl_pb.learning.runs.checkpoint import CheckpointError, check_whole, fill, reading, tensors_of
from chmarl_pb.learning.runs.seal import seal
from chmarl_pb.learning.runs.threads import threads
from chmarl_pb.learning.sb3.config import ALGORITHMS, BEFORE_PRESETS, PRESETS, Config
from chmarl_pb.learning.sb3.wrappers import encoded
from chmarl_pb.learning.spaces import stack
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy, grasps
from chmarl_pb.policies.registry import make_policy

_SETTINGS = "chmarl_pb.json"  # member of the zip
_COMMON = {"instruction", "feedback", "messages", "self", "node_class", "rgb", GOAL}  # keys of one robot


def save_model(model: BaseAlgorithm, config: Config, path: Path) -> None:
    """Write a model, whole or not at all, so that SB3 and :func:`load_policy` can read it."""
    with replacing(path) as temporary:
        with temporary.open("wb") as file:
            model.save(file)
        with zipfile.ZipFile(temporary, "a") as archive:
            archive.writestr(_SETTINGS, json.dumps(asdict(config)))
        seal(temporary)


def load_policy(path: Path) -> "Sb3Policies":
    """Return what makes the policy of a ``best.zip``; entry point ``chmarl_pb.checkpoints``.

    Only the settings (JSON) and the weights (``weights_only=True``) are read, so no code of the file is run.
    SB3's own ``load`` unpickles the rest of the zip, which can run any code: use it on files that you trust only.

    Raises:
        CheckpointError: the file is damaged, or was not written by ``training.sb3``.
    """
    return Sb3Policies(path)


class Sb3Policies:
    """Makes the policies of a model; can be sent to other processes."""

    def __init__(self, path: Path):
        """Remember the path of a model."""
        self.path = path
        config = read_model(path)[0]
        # As `evaluate` asks; where pictures are observed, the others are told what is in view, as in training.
        self.deterministic, self.centralized = not config.sampled, not config.alone
        self.privileged = config.alone and config.observation == "visual"
        self.rules: dict[str, Any] = {"track": config.track} if config.track != PAPER else {}
        if self.rules and not config.messages:
            self.rules["messages"] = False

    def __call__(self, env: HouseholdEnv) -> Policy:
        """Return the policy for an environment.

        Raises:
            CheckpointError: the model was trained with other observations, actions or frozen weights.
        """
        config, weights = read_model(self.path)
        check_size(env, asdict(config), self.path)
        check_catalog(env, asdict(config), self.path)
        check_rules(env, self.rules, self.path)
        if PRESETS[config.preset].goal and not env.options.goal:
            raise CheckpointError(
                f"{self.path}: was trained with goal=True; make the environment so (chmarl-pb evaluate --goal)"
            )
        network = _network(config, env)
        fill(network, weights, self.path)
        network.set_training_mode(False)
        encoder = trained_with(config.image_encoder, config.frozen, self.path) if config.frozen else None
        network.requires_grad_(False)
        silent = silenced(asdict(config))
        return BatchOfOne(Sb3Policy(network, env, config.sampled, silent, encoder, config.partner))


def policy_of(model: BaseAlgorithm, partner: str | None = None) -> "ModelPolicies":
    """Return what makes the policy of a model in memory, for ``chmarl_pb.evaluate(policy_of(model), workers=1, ...)``.

    Args:
        model: of Stable-Baselines3, trained on one of the ids; wrappers may have left keys out, but not changed them.
        partner: policy of the others beside a humanoid that learned alone, "search" or "belief"; None: that of the
            model's environments, or "search" for a model that has none.

    Raises:
        ValueError: the model was trained on normalised observations, or its environments are closed and no partner is
            given.
    """
    normalised = model.get_vec_normalize_env()
    if normalised is not None and normalised.norm_obs:
        raise ValueError("the model knows normalised observations only; train it with VecNormalize(norm_obs=False)")
    return ModelPolicies(model, partner or _partner_of(model))


def _partner_of(model: BaseAlgorithm) -> str:
    """Return the policy of the robots that did not learn."""
    env = model.get_env()
    if env is None or not _COMMON & set(_keys_of(model.policy)):
        return PARTNERS[0]
    try:
        return str(env.get_attr("partner")[0]) if env.has_attr("partner") else PARTNERS[0]
    except ClosedEnvironmentError as error:
        known = " or ".join(f"partner={name!r}" for name in PARTNERS)
        raise ValueError(f"the model's environments are closed; say what drove the drone there: {known}") from error


class ModelPolicies:
    """Makes the policies of a model."""

    def __init__(self, model: BaseAlgorithm, partner: str):
        """Remember a model, and the policy of those that it does not drive."""
        self._network, self._partner = model.policy, partner
        self.deterministic = not hasattr(self._network, "get_distribution")  # as `evaluate` asks
        keys = set(_keys_of(self._network))
        self.centralized = not _COMMON & keys  # keys of all robots have their names before them
        self.privileged = not self.centralized and IMAGE in keys  # the others are told what is in view, as in training

    def __call__(self, env: HouseholdEnv) -> Policy:
        """Return the policy for an environment.

        Raises:
            OptionError: the environment does not give all that the model observes.
        """
        parts = {name: dict(env.observation_space(name).spaces) for name in env.possible_agents}
        given = parts[_learner(env)] | joined(parts)
        if missing := [key for key in _keys_of(self._network) if key not in given]:
            raise OptionError(f"the model observes {', '.join(missing)}, too; give the option, e.g. goal=True")
        self._network.set_training_mode(False)
        return BatchOfOne(Sb3Policy(self._network, env, not self.deterministic, partner=self._partner))


class Sb3Policy:
    """Drives the robots of several episodes; each episode draws its actions from a stream of its own.

    One network drives all robots, or the first that grasps alone while the others follow a built-in policy.
    """

    def __init__(
        self,
        network: BasePolicy,
        env: HouseholdEnv,
        sampled: bool,
        silenced: tuple[str, ...] = (),
        encoder: FrozenEncoder | None = None,
        partner: str = PARTNERS[0],
    ):
        """Take a network over.

        Args:
            network: what chooses the actions.
            env: environment to act in.
            sampled: whether actions are drawn; if not, the best are taken.
            silenced: names of the keys that read as zeros, as they did in training.
            encoder: what turns pictures into the features that the network sees; None: it sees pictures.
            partner: policy of the robots that the network does not drive.
        """
        self._network: Any = network  # its kinds have no common type
        self._sampled, self._silenced, self._encoder = sampled, silenced, encoder
        self._make_others = partial(make_policy, partner, env)
        self._counts = {name: flat_counts(env.action_space(name)) for name in env.possible_agents}
        self._keys, self._others = _keys_of(network), list[Policy]()
        prefixes = tuple(f"{name}_" for name in self._counts)
        self._alone = None if any(key.startswith(prefixes) for key in self._keys) else _learner(env)

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed."""
        self._streams = [torch.Generator().manual_seed(seed or 0) for seed in seeds]
        if self._alone:
            while len(self._others) < len(seeds):
                self._others.append(self._make_others())
            for others, seed in zip(self._others, seeds, strict=False):
                others.reset(seed)
        if self._recurrent:
            layers, _, units = self._network.lstm_hidden_state_shape
            self._memory = [torch.zeros(layers, len(seeds), units) for _ in range(2)]

    @threads(1)
    @torch.no_grad()
    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return the actions in the episodes with these numbers."""
        if self._alone and self._alone not in observations[0]:
            return list(map(self._others_act, episodes, observations, infos))
        parts = [one[self._alone] if self._alone else joined(one) for one in observations]
        batch = stack([{key: part[key] for key in self._keys} for part in parts])
        batch |= {key: np.zeros_like(batch[key]) for key in named(batch, *self._silenced)}
        if self._encoder is not None:
            batch = encoded(batch, self._encoder)
        numbers = self._numbers(episodes, self._network.obs_to_tensor(batch)[0]).tolist()
        if self._alone:
            others = map(self._others_act, episodes, observations, infos)
            return [{self._alone: number} | actions for number, actions in zip(numbers, others, strict=True)]
        if isinstance(self._network.action_space, spaces.Discrete):
            counts = [count for own in self._counts.values() for count in own]
            numbers = np.stack(np.unravel_index(numbers, counts), axis=1).tolist()
        return list(map(self._parted, numbers))

    def _parted(self, row: list[int]) -> Actions:
        """Return each robot's part of a row of numbers: its action, or with own words a pair."""
        parts = {name: [row.pop(0) for _ in counts] for name, counts in self._counts.items()}
        return {name: part[0] if len(part) == 1 else tuple(part) for name, part in parts.items()}  # type: ignore[misc]

    def _others_act(self, episode: int, observations: Observations, infos: Infos) -> Actions:
        """Return the actions of the robots that do not learn."""
        seen = {name: self._heard(own) for name, own in observations.items() if name != self._alone}
        return self._others[episode].act(seen, {name: infos[name] for name in seen}) if seen else {}

    def _heard(self, seen: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
        """Return what a robot observes, without what it did not hear in training."""
        return seen | {key: np.zeros_like(seen[key]) for key in self._silenced}

    @property
    def _recurrent(self) -> bool:
        return hasattr(self._network, "lstm_hidden_state_shape")

    def _numbers(self, episodes: Sequence[int], batch: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return (B) numbers of actions, or (B, robots) for all robots."""
        if not self._sampled:
            likeliest: torch.Tensor = self._network._predict(batch, deterministic=True)
            return likeliest
        if self._recurrent:
            before = tuple(part[:, episodes] for part in self._memory)
            found, after = self._network.get_distribution(batch, before, torch.zeros(len(episodes)))
            for memory, part in zip(self._memory, after, strict=True):
                memory[:, episodes] = part
        else:
            found = self._network.get_distribution(batch)
        robots = found.distribution if isinstance(found.distribution, list) else [found.distribution]
        drawn = [
            [torch.multinomial(robot.probs[row], 1, generator=self._streams[number]) for robot in robots]
            for row, number in enumerate(episodes)
        ]
        return torch.tensor(drawn).squeeze(1)


def _keys_of(network: BasePolicy) -> tuple[str, ...]:
    """Return the keys of the observations that a network was made for."""
    assert isinstance(network.observation_space, spaces.Dict)
    return tuple(network.observation_space)


def flat_counts(space: spaces.Space[Any]) -> list[int]:
    """Return how many values each number of a robot's action may have: one number, or with own words a pair."""
    return space.nvec.tolist() if isinstance(space, spaces.MultiDiscrete) else [int(space.n)]  # type: ignore[attr-defined]


def joined(robots: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of all robots as the joint ids name them."""
    return {f"{name}_{key}": value for name, own in robots.items() for key, value in own.items()}


def _learner(env: HouseholdEnv) -> str:
    """Return the robot that learns if one does alone: the first that grasps."""
    return next(name for name, actions in env.action_names.items() if grasps(actions))


def _network(config: Config, env: HouseholdEnv) -> BasePolicy:
    """Return the network with new weights."""
    parts, learner = {name: dict(env.observation_space(name).spaces) for name in env.possible_agents}, _learner(env)
    seen = parts[learner] if config.alone else joined(parts)
    # What the network was not trained with, as the goal, is left out.
    read = config.keys or tuple(name for name in parts[learner] if name != GOAL or PRESETS[config.preset].goal)
    space = spaces.Dict({key: seen[key] for key in named(seen, *read)})
    if config.frozen:
        space = feature_space(space, frozen_encoder(config.image_encoder))
    for key, part in space.items():
        if isinstance(part, spaces.Box) and is_image_space(part):
            space.spaces[key] = VecTransposeImage.transpose_space(part)  # as SB3 trains
    counts = [count for name in env.possible_agents for count in flat_counts(env.action_space(name))]
    actions: spaces.Space[Any] = spaces.MultiDiscrete(counts)
    if config.alone:
        actions = env.action_space(learner)
    elif config.env_options.get("flat_actions"):
        actions = spaces.Discrete(math.prod(counts))
    algorithm = ALGORITHMS[config.algo]
    make = algorithm.model.policy_aliases[algorithm.policy]
    return make(space, actions, lambda _: 0.0, **config.policy_kwargs)


def read_model(path: Path) -> tuple[Config, dict[str, torch.Tensor]]:
    """Return settings and weights.

    Raises:
        CheckpointError: the file is damaged, or was not written by ``training.sb3``.
    """
    check_whole(path)
    try:
        with zipfile.ZipFile(path) as archive:
            if _SETTINGS not in archive.namelist():
                raise CheckpointError(
                    f"{path}: was not written by training.sb3. Other models of Stable-Baselines3 can run code when "
                    "they are loaded; to evaluate one that you trust, load it in a module:callable and return "
                    "chmarl_pb.learning.sb3.policy_of(model)(env)"
                )
            with reading(path):
                config = Config(**{**BEFORE_PRESETS, **json.loads(archive.read(_SETTINGS))})
                with archive.open("policy.pth") as file:
                    return config, tensors_of(file, path)
    except (OSError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{path}: not a whole checkpoint ({error}); copy or train it again") from error
