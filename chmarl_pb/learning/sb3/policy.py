"""Models of Stable-Baselines3 as policies of the benchmark."""

import math
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

import numpy as np
import torch
from gymnasium import spaces
from gymnasium.error import ClosedEnvironmentError
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.policies import BasePolicy

from chmarl_pb.envs.joint import PARTNERS, joined
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import OptionError
from chmarl_pb.fingerprint import fingerprint
from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.observation_keys import IMAGE, are_of_all, named
from chmarl_pb.learning.policies.checks import silenced as silenced_in
from chmarl_pb.learning.rollouts.batched import BatchOfOne
from chmarl_pb.learning.sb3.wrappers import encoded
from chmarl_pb.learning.spaces import stack
from chmarl_pb.learning.threads import threads
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy, first_grasper
from chmarl_pb.policies.registry import make_policy

_CLOSED = (ClosedEnvironmentError, OSError, EOFError)  # what closed environments raise, ours and SB3's
_TRAINING = {"lr_schedule", "optimizer_class", "optimizer_kwargs"}  # what a network is made from, to be trained


def policy_of(
    model: BaseAlgorithm, partner: str | None = None, silenced: Sequence[str] | None = None
) -> "ModelPolicies":
    """Return what makes the policy of a model in memory, for ``chmarl_pb.evaluate(policy_of(model), workers=1, ...)``.

    Args:
        model: of Stable-Baselines3, trained on one of the ids; wrappers may have left keys out, but not changed them.
        partner: policy of the others beside a humanoid that learned alone, "search" or "belief"; None: that of the
            model's environments, or "search" for a model that has none.
        silenced: which of "messages" and "feedback" read as zeros, as they did in training; None: those of the model's
            environments, or none for a model that has none, or closed ones.

    Raises:
        ValueError: the model was trained on normalised observations, or its environments are closed and no partner is
            given.
    """
    normalised = model.get_vec_normalize_env()
    if normalised is not None and normalised.norm_obs:
        raise ValueError("the model knows normalised observations only; train it with VecNormalize(norm_obs=False)")
    unheard = _unheard_by(model) if silenced is None else tuple(silenced)
    return ModelPolicies(model, partner or _partner_of(model), unheard)


def _partner_of(model: BaseAlgorithm) -> str:
    """Return the policy of the robots that did not learn."""
    env = model.get_env()
    if env is None or are_of_all(_keys_of(model.policy)):
        return PARTNERS[0]
    try:
        return str(env.get_attr("partner")[0]) if env.has_attr("partner") else PARTNERS[0]
    except _CLOSED as error:
        known = " or ".join(f"partner={name!r}" for name in PARTNERS)
        raise ValueError(f"the model's environments are closed; say what drove the drone there: {known}") from error


def _unheard_by(model: BaseAlgorithm) -> tuple[str, ...]:
    """Return the keys that read as zeros in a model's environments."""
    env = model.get_env()
    try:
        options = env.get_attr("options")[0] if env is not None and env.has_attr("options") else None
    except _CLOSED:
        options = None
    return silenced_in(vars(options)) if isinstance(options, Options) else ()


class ModelPolicies:
    """Makes the policies of a model."""

    def __init__(self, model: BaseAlgorithm, partner: str, unheard: tuple[str, ...] = ()):
        """Remember a model, the policy of those that it does not drive, and the keys that read as zeros."""
        self._network, self._partner, self._unheard = model.policy, partner, unheard
        self.deterministic = not hasattr(self._network, "get_distribution")  # as `evaluate` asks
        keys = _keys_of(self._network)
        self.centralized = are_of_all(keys)
        self.privileged = not self.centralized and IMAGE in keys  # the others are told what is in view, as in training

    @property
    def fingerprint(self) -> str | None:
        """Hash of what chooses the actions; how it was trained, and whether it is being trained, are no part of it."""
        network = self._network
        shape = {key: value for key, value in network._get_constructor_parameters().items() if key not in _TRAINING}
        spoken = {key: repr(value) if isinstance(value, spaces.Space) else value for key, value in shape.items()}
        own = (self._partner, *self._unheard)
        return fingerprint((type(network), spoken, dict(network.state_dict()), *own))

    def __call__(self, env: HouseholdEnv) -> Policy:
        """Return the policy for an environment.

        Raises:
            OptionError: the environment does not give all that the model observes.
        """
        parts = {name: dict(env.observation_space(name).spaces) for name in env.possible_agents}
        given = parts[first_grasper(env.action_names)] | joined(parts)
        if missing := [key for key in _keys_of(self._network) if key not in given]:
            raise OptionError(f"the model observes {', '.join(missing)}, too; give the option, e.g. goal=True")
        self._check_spaces(env, given)
        self._network.set_training_mode(False)
        policy = Sb3Policy(self._network, env, not self.deterministic, self._unheard, partner=self._partner)
        return BatchOfOne(policy)

    def _check_spaces(self, env: HouseholdEnv, given: Mapping[str, spaces.Space[Any]]) -> None:
        """Refuse an environment in which the model's numbers would mean something else.

        Raises:
            OptionError: its observations have other sizes, or its actions are others.
        """
        own = self._network.observation_space
        assert isinstance(own, spaces.Dict)
        for key, space in own.items():
            if sorted(space.shape or ()) != sorted(given[key].shape or ()):  # SB3 turns pictures
                raise OptionError(
                    f"the model observes {key} of shape {space.shape}, and here it has {given[key].shape}; give the "
                    "options that it was trained with"
                )
        robots = env.possible_agents if self.centralized else [first_grasper(env.action_names)]
        counts = [count for robot in robots for count in flat_counts(env.action_space(robot))]
        actions = flat_counts(self._network.action_space)
        if actions not in (counts, [math.prod(counts)]):
            raise OptionError(
                f"the model chooses among {actions} actions, and here there are {counts}; give the options that it "
                "was trained with"
            )


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
        self._alone = None if any(key.startswith(prefixes) for key in self._keys) else first_grasper(env.action_names)

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
            self._memory = [torch.zeros(layers, len(seeds), units, device=self._network.device) for _ in range(2)]

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
            starts = torch.zeros(len(episodes), device=self._network.device)
            found, after = self._network.get_distribution(batch, before, starts)
            for memory, part in zip(self._memory, after, strict=True):
                memory[:, episodes] = part
        else:
            found = self._network.get_distribution(batch)
        robots = found.distribution if isinstance(found.distribution, list) else [found.distribution]
        shares = [robot.probs.cpu() for robot in robots]  # where the streams are, whatever the network is on
        drawn = [
            [torch.multinomial(share[row], 1, generator=self._streams[number]) for share in shares]
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
