"""``best.zip`` of a run: a model of Stable-Baselines3 with our settings beside it, and the policy made from it."""

import json
import math
import zipfile
from dataclasses import asdict
from pathlib import Path
from typing import Any

import torch
from gymnasium import spaces
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy
from stable_baselines3.common.preprocessing import is_image_space
from stable_baselines3.common.vec_env import VecTransposeImage

from chmarl_pb.envs.joint import joined
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import PAPER, TRACKS
from chmarl_pb.files import replacing
from chmarl_pb.learning.config import RULES
from chmarl_pb.learning.networks.frozen import FrozenEncoder, trained_with
from chmarl_pb.learning.networks.kept_features import feature_space
from chmarl_pb.learning.observation_keys import GOAL, named
from chmarl_pb.learning.policies.checks import check_names, check_rules, check_size, image_size_of, silenced
from chmarl_pb.learning.policies.own_code import own_code
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.sb3.config import ALGORITHMS, BEFORE_PRESETS, PRESETS, Config
from chmarl_pb.learning.sb3.policy import Sb3Policy, flat_counts
from chmarl_pb.learning.storage.checkpoint import CheckpointError, check_whole, fill, reading, tensors_of
from chmarl_pb.learning.storage.seal import seal
from chmarl_pb.policies.policy import Policy, first_grasper

_SETTINGS = "chmarl_pb.json"  # member of the zip


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
        CheckpointError: the file is damaged, or was not written by ``chmarl-pb sb3``.
    """
    return Sb3Policies(path)


class Sb3Policies:
    """Makes the policies of a model; can be sent to other processes."""

    def __init__(self, path: Path):
        """Remember the path of a model."""
        self.path = path
        config = read_model(path)[0]
        self._named = {"graph_pool": config.graph_pool, "image_encoder": config.image_encoder}
        # As `evaluate` asks; where pictures are observed, the others are told what is in view, as in training.
        self.deterministic, self.centralized = not config.sampled, not config.alone
        self.privileged = config.alone and config.observation == "visual"
        self.rules: dict[str, Any] = {"track": config.track} if config.track != PAPER else {}
        if self.rules and not config.messages:
            self.rules["messages"] = False
        self.rules |= image_size_of(asdict(config))
        if config.max_steps != TRACKS[config.track]["max_steps"]:
            self.rules["max_steps"] = config.max_steps
        if PRESETS[config.preset].goal:
            self.rules[GOAL] = True

    @property
    def code(self) -> tuple[Any, ...]:
        """The user's own code that plays by these weights, see :func:`own_code`."""
        return own_code(self._named, self.path)

    def __call__(self, env: HouseholdEnv) -> Policy:
        """Return the policy for an environment.

        Raises:
            CheckpointError: the model was trained with other observations, actions or frozen weights.
        """
        with reading(self.path):
            return self._policy(env)

    def _policy(self, env: HouseholdEnv) -> Policy:
        config, weights = read_model(self.path)
        check_size(env, asdict(config), self.path)
        check_names(env, asdict(config), self.path)
        check_rules(env, {RULES: self.rules}, self.path)
        if PRESETS[config.preset].goal and not env.options.goal:
            raise CheckpointError(
                f"{self.path}: was trained with goal=True; make the environment so (chmarl-pb evaluate --goal)"
            )
        encoder = trained_with(config.image_encoder, config.frozen, self.path) if config.frozen else None
        network = _network(config, env, encoder)
        fill(network, weights, self.path)
        network.set_training_mode(False)
        network.requires_grad_(False)
        silent = silenced(config.env_options)
        return BatchOfOne(Sb3Policy(network, env, config.sampled, silent, encoder, config.partner))


def _network(config: Config, env: HouseholdEnv, encoder: FrozenEncoder | None) -> BasePolicy:
    """Return the network with new weights; an encoder, if there is one, turns pictures into what it sees."""
    parts = {name: dict(env.observation_space(name).spaces) for name in env.possible_agents}
    learner = first_grasper(env.action_names)
    seen = parts[learner] if config.alone else joined(parts)
    # What the network was not trained with, as the goal, is left out.
    read = config.keys or tuple(name for name in parts[learner] if name != GOAL or PRESETS[config.preset].goal)
    space = spaces.Dict({key: seen[key] for key in named(seen, *read)})
    if encoder is not None:
        space = feature_space(space, encoder)
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
        CheckpointError: the file is damaged, or was not written by ``chmarl-pb sb3``.
    """
    check_whole(path)
    try:
        with zipfile.ZipFile(path) as archive:
            if _SETTINGS not in archive.namelist():
                raise CheckpointError(
                    f"{path}: was not written by chmarl-pb sb3. Other models of Stable-Baselines3 can run code when "
                    "they are loaded; to evaluate one that you trust, load it in a module:callable and return "
                    "chmarl_pb.learning.sb3.policy_of(model)(env)"
                )
            with reading(path):
                config = Config(**{**BEFORE_PRESETS, **json.loads(archive.read(_SETTINGS))})
                with archive.open("policy.pth") as file:
                    return config, tensors_of(file, path)
    except (OSError, zipfile.BadZipFile) as error:
        raise CheckpointError(f"{path}: not a whole checkpoint ({error}); copy or train it again") from error
