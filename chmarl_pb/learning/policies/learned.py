"""Checkpoints as policies, for ``chmarl-pb evaluate --policy CHECKPOINT``: entry point ``chmarl_pb.checkpoints``."""

from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.learning.algorithms.losses import best_legal
from chmarl_pb.learning.algorithms.registry import ALGORITHMS
from chmarl_pb.learning.config import FROZEN, RunConfig
from chmarl_pb.learning.networks.agents import Player, make_agents
from chmarl_pb.learning.networks.frozen import FrozenEncoder, trained_with
from chmarl_pb.learning.networks.kept_features import FeatureEnv, with_features
from chmarl_pb.learning.policies.checks import check_size, silenced
from chmarl_pb.learning.runs.checkpoint import CheckpointError, fill, load, reading
from chmarl_pb.learning.runs.threads import threads
from chmarl_pb.learning.spaces import over, spaces_of
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy


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
            return ALGORITHMS[content["algorithm"]].config(**content["config"])
        except (KeyError, TypeError) as error:
            raise CheckpointError(
                f"{self.path}: its settings are of another version ({error}); train it again"
            ) from error
