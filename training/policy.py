"""Checkpoints as policies, for ``chmarl-pb evaluate --policy CHECKPOINT``: entry point ``chmarl_pb.checkpoints``."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.evaluation.policies import Factory
from chmarl_pb.planner.policy import Actions, Infos, Observations, Policy
from training.agents import Player, make_agents
from training.checkpoint import CheckpointError, fill, load, reading
from training.config import CONFIGS, FROZEN, RunConfig
from training.encoders.frozen import FrozenEncoder, trained_with
from training.features import FeatureEnv, with_features
from training.losses import best_legal
from training.spaces import over, spaces_of
from training.threads import threads


class LearnedPolicy:
    """Drives each agent by the best action of its own network."""

    def __init__(self, agents: nn.ModuleDict, silenced: tuple[str, ...] = (), encoder: FrozenEncoder | None = None):
        """Take the networks over; they must not be trained while an episode is played.

        Args:
            agents: agent -> its network.
            silenced: keys of observations that read as zeros, as they did in training.
            encoder: what turns pictures into the features that the networks see; None: they see pictures.
        """
        self.agents, self.silenced, self.encoder = agents, silenced, encoder
        self._only = torch.tensor([0])

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""
        self._player = Player(self.agents, 1)

    @threads(1)
    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return each agent's best legal action."""
        actions = {}
        if self.encoder is not None:
            observations = with_features(observations, self.encoder)
        for name, seen in observations.items():
            heard = seen | {key: np.zeros_like(seen[key]) for key in self.silenced} if self.silenced else seen
            batch = over(lambda part: torch.from_numpy(np.asarray(part)[None]), heard)
            values = self._player.values(name, self._only, batch)
            mask = infos[name].get("action_mask", np.ones(values.shape[1]))
            best = best_legal(values, torch.from_numpy(np.asarray(mask, dtype=bool)[None]))
            self._player.remember(name, self._only, best)
            actions[name] = int(best)
        return actions


def load_policy(path: Path) -> Factory:
    """Return what makes the policy of a checkpoint of any kind.

    Raises:
        CheckpointError: the file is missing, damaged, or holds no policy.
    """
    kind = load(path)["kind"]
    if kind == "bc":
        from training.bc.cloning import load_policy as load_cloned

        return load_cloned(path)
    if kind != "value":
        raise CheckpointError(
            f"{path}: holds a checkpoint of kind {kind!r}, which is no policy; use best.pt of the run"
        )
    return ValuePolicies(path)


class ValuePolicies:
    """Makes the policies of a checkpoint of value factorisation; can be sent to other processes."""

    deterministic = True

    def __init__(self, path: Path):
        """Remember the path of a checkpoint."""
        self.path = path

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
        config, frozen = self._config(content), content["setting"].get(FROZEN, "")
        encoder = trained_with(config.image_encoder, frozen, self.path) if frozen else None
        observations, actions = spaces_of(FeatureEnv(env, encoder) if encoder else env)
        seen = {name: str(space) for name, space in observations.items()}
        for what, own in (("observations", seen), ("actions", actions)):
            if content[what] != own:
                raise CheckpointError(f"{self.path}: was trained with the {what} {content[what]}, not {own}")
        agents = make_agents(observations, actions, config)
        fill(agents, content["agents"], self.path)
        agents.requires_grad_(False).eval()
        return LearnedPolicy(agents, silenced(content["setting"]), encoder)

    def _config(self, content: dict[str, Any]) -> RunConfig:
        try:
            return CONFIGS[content["algorithm"]](**content["config"])
        except (KeyError, TypeError) as error:
            raise CheckpointError(
                f"{self.path}: its settings are of another version ({error}); train it again"
            ) from error


def check_size(env: HouseholdEnv, setting: Mapping[str, Any], path: Path) -> None:
    """Check that pictures are as large as in training; frozen features of others have the same shape.

    Args:
        env: environment to act in.
        setting: of the training.
        path: of the checkpoint, for the error.

    Raises:
        CheckpointError: they are not.
    """
    own = env.options.image_size
    if env.options.observation == "visual" and (wanted := setting.get("image_size", own)) != own:
        raise CheckpointError(
            f"{path}: was trained with pictures of {wanted} pixels, not {own}; give image_size={wanted}"
        )


def silenced(setting: dict[str, Any]) -> tuple[str, ...]:
    """Return the keys that read as zeros in training: ``messages`` and ``feedback``, where they were off."""
    return tuple(key for key in ("messages", "feedback") if not setting.get(key, True))
