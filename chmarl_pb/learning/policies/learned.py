"""Checkpoints of learners that play, as policies."""

import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from torch import nn

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning.algorithms.registry import find_algorithm
from chmarl_pb.learning.config import FROZEN, RULES, RunConfig
from chmarl_pb.learning.lookup import UntrustedError
from chmarl_pb.learning.networks.agents import make_agents
from chmarl_pb.learning.networks.frozen import FrozenEncoder, trained_with
from chmarl_pb.learning.networks.kept_features import FeatureEnv, all_with_features
from chmarl_pb.learning.observation_keys import GOAL
from chmarl_pb.learning.policies.checks import (
    check_names,
    check_rules,
    check_size,
    differences,
    image_size_of,
    lacking_own_parts,
    silenced,
)
from chmarl_pb.learning.policies.own_code import own_code
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.rollouts.collect import Explorer, greedy
from chmarl_pb.learning.spaces import spaces_of
from chmarl_pb.learning.storage.checkpoint import CheckpointError, fill, load, reading
from chmarl_pb.learning.threads import threads
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.processes import is_helper


class ValuePolicy:
    """Drives each agent by the best action of its own network, in several episodes at once.

    Attributes:
        acting: chooses the actions from what the networks give for them.
    """

    def __init__(self, agents: nn.ModuleDict, silenced: tuple[str, ...] = (), encoder: FrozenEncoder | None = None):
        """Take the networks over; they must not be trained while an episode is played.

        Args:
            agents: agent -> its network.
            silenced: keys of observations that read as zeros, as they did in training.
            encoder: what turns images into the features that the networks see; None: they see images.
        """
        self.agents, self.silenced, self.encoder = agents, silenced, encoder
        self.acting = Explorer(agents, greedy, np.random.default_rng(0))  # draws nothing

    def reset(self, seeds: Sequence[int | None]) -> None:
        """Begin one episode for each seed."""
        self.acting.reset(seeds)

    @threads(1)
    def act(
        self, episodes: Sequence[int], observations: Sequence[Observations], infos: Sequence[Infos]
    ) -> list[Actions]:
        """Return each agent's best action among those that its mask allows."""
        seen = all_with_features(observations, self.encoder) if self.encoder else observations
        silent = [{name: own | {key: np.zeros_like(own[key]) for key in self.silenced} for name, own in one.items()}
                  for one in seen]  # fmt: skip
        return self.acting.act(episodes, silent, infos)


class ValuePolicies:
    """Makes the policies of a checkpoint of value factorisation; can be sent to other processes."""

    deterministic = True

    def __init__(self, path: Path):
        """Remember the path of a checkpoint, and the rules that it was trained by.

        Raises:
            CheckpointError: it is damaged, or of another kind.
        """
        self.path, self._told = path, set[str]()
        with reading(path):
            content = load(path, "value")
            setting, self._named = content["setting"], {**content["config"], "algorithm": content["algorithm"]}
            goal = {GOAL: True} if setting.get(GOAL) else {}
            self.rules: dict[str, Any] = {**setting.get(RULES, {}), **image_size_of(setting), **goal}
            Options(**self.rules)  # a later version may know other rules

    @property
    def code(self) -> tuple[Any, ...]:
        """The user's own code that plays by these weights, see :func:`own_code`."""
        return own_code(self._named, self.path)

    def __call__(self, env: HouseholdEnv) -> Policy:
        """Return the policy for an environment.

        Raises:
            CheckpointError: the checkpoint was trained with other observations, actions or frozen weights, or comes
                from another version.
        """
        with reading(self.path):
            return self._policy(env, load(self.path, "value"))

    def _policy(self, env: HouseholdEnv, content: dict[str, Any]) -> Policy:
        check_size(env, content["setting"], self.path)
        check_names(env, content["setting"], self.path)
        config, frozen = self._config(content), content["setting"].get(FROZEN, "")
        encoder = trained_with(config.image_encoder, frozen, self.path) if frozen else None
        check_rules(env, content["setting"], self.path)
        observations, actions = spaces_of(FeatureEnv(env, encoder) if encoder else env)
        seen = {name: str(space) for name, space in observations.items()}
        if content["observations"] != seen:
            other = differences(content["observations"], seen)
            raise CheckpointError(f"{self.path}: was trained with other observations, {other}")
        if content["actions"] != actions:
            raise CheckpointError(f"{self.path}: was trained with the actions {content['actions']}, not {actions}")
        self._tell(lacking_own_parts(env.options, content["setting"], self.path))
        agents = make_agents(observations, actions, config)
        fill(agents, content["agents"], self.path)
        agents.requires_grad_(False).eval()
        return BatchOfOne(ValuePolicy(agents, silenced(content["setting"]), encoder))

    def _tell(self, warning: str) -> None:
        """Warn once, not for each robot; processes that help this one are silent, as this one has said it."""
        if warning and warning not in self._told and not is_helper():
            self._told.add(warning)
            warnings.warn(warning, stacklevel=2)

    def _config(self, content: dict[str, Any]) -> RunConfig:
        try:
            algorithm = find_algorithm(content["algorithm"])
        except UntrustedError:
            raise
        except ValueError as error:
            raise CheckpointError(
                f"{self.path}: {error}; import what adds it in every process, or train by module:name"
            ) from error
        try:
            return algorithm.config(**content["config"])
        except TypeError as error:
            raise CheckpointError(
                f"{self.path}: its settings are of another version ({error}); train it again"
            ) from error
