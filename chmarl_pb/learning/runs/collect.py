"""Play episodes side by side in one process, with agents that act in one batch."""

from collections.abc import Callable, Sequence
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from chmarl_pb.learning.algorithms.losses import best_legal
from chmarl_pb.learning.networks.agents import Player
from chmarl_pb.learning.networks.kept_features import reset_all, step_all
from chmarl_pb.learning.runs.replay_buffer import Episode
from chmarl_pb.learning.spaces import Interface, interface_of, over, stack, tensors, zeros
from chmarl_pb.policies.policy import Policy

NO_LABEL = -1  # nobody has said what would have been right


class Choose(Protocol):
    """How actions are chosen from what the networks give for them."""

    def __call__(self, values: Tensor, legal: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the actions (B).

        Args:
            values: (B, A) of the actions.
            legal: (B, A) bool.
            labels: (B) what the teacher would do, or ``NO_LABEL``.
            rng: for random choices.
        """


class Teacher(Protocol):
    """Says in every state what to do, and goes on from what was done instead.

    Any :class:`chmarl_pb.policies.policy.Policy` can teach; one that keeps count of what it has done should be able to
    do this, as :class:`chmarl_pb.policies.search.SearchPolicy` is: ``act`` of a policy counts what it says.
    """

    def reset(self, seed: int | None) -> None:
        """Forget the last episode."""

    def propose(self, observations: dict[str, Any], infos: dict[str, Any]) -> dict[str, int]:
        """Return agent -> what it should do."""

    def note(self, actions: dict[str, int]) -> None:
        """Learn what the agents have done."""


class Unheeding:
    """A policy as a teacher that does not want to know what was done."""

    def __init__(self, policy: Policy):
        """Take a policy."""
        self.reset, self.propose = policy.reset, policy.act

    def note(self, actions: dict[str, int]) -> None:
        """Do nothing."""


def as_teacher(policy: Any) -> Teacher:
    """Return a policy as a teacher."""
    return policy if hasattr(policy, "propose") and hasattr(policy, "note") else Unheeding(policy)


def epsilon_greedy(epsilon: float) -> Choose:
    """Return the best legal actions, but for a share of random ones."""

    def choose(values: Tensor, legal: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        best = best_legal(values, legal).numpy()
        random = np.array([rng.choice(np.flatnonzero(row)) for row in legal.numpy()])
        return np.where(rng.random(len(best)) < epsilon, random, best)

    return choose


def greedy(values: Tensor, legal: Tensor, labels: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return the best legal actions."""
    return best_legal(values, legal).numpy()


class Collector:
    """Several environments of one kind.

    Attributes:
        envs: the environments.
        interface: what a learner has to know of them.
        steps: joint steps that were played.
    """

    def __init__(
        self,
        env_fn: Callable[[], Any],
        count: int,
        teacher: Callable[[Any], Teacher | Policy] | None = None,
        horizon: int | None = None,
        check: Callable[[], None] = lambda: None,
    ):
        """Make the environments.

        Args:
            env_fn: makes one.
            count: how many.
            teacher: makes a teacher in each of them, if wanted.
            horizon: most steps of an episode; None: any number.
            check: called before every joint step; may raise an error to end the episodes.
        """
        self._horizon, self._check = horizon, check
        self.envs = [env_fn() for _ in range(count)]
        self._teachers = [as_teacher(teacher(env)) for env in self.envs] if teacher else []
        self.interface: Interface = interface_of(self.envs[0])
        self.steps = 0

    def play(
        self,
        agents: nn.ModuleDict,
        choose: Choose,
        rng: np.random.Generator,
        seeds: Sequence[int],
        options: Sequence[dict[str, Any] | None] | None = None,
        taught: bool = False,
    ) -> list[Episode]:
        """Play one episode in each of the first environments.

        Args:
            agents: agent -> its network.
            choose: chooses the actions.
            rng: of random choices.
            seeds: of the resets, one for each episode, at most as many as there are environments.
            options: of the resets.
            taught: whether the teachers, if there are any, say what they would do.

        Raises:
            ValueError: an episode goes on after ``horizon`` steps.
        """
        envs = self.envs[: len(seeds)]
        starts = reset_all(envs, seeds, options or [None] * len(seeds))
        episodes = [begin(self.interface, env, start) for env, start in zip(envs, starts, strict=True)]
        player = Player(agents, len(episodes))
        teachers = self._teachers[: len(episodes)] if taught else []
        for teacher, seed in zip(teachers, seeds, strict=False):
            teacher.reset(seed)
        while running := [number for number, env in enumerate(self.envs[: len(episodes)]) if env.agents]:
            self._check()
            for number in running if teachers else ():
                episode = episodes[number]
                episode.labels.append(teachers[number].propose(episode.observations[-1], episode.info))
            actions = self._choose(player, episodes, running, choose, rng)
            for number in running if teachers else ():
                teachers[number].note(actions[number])
            steps = step_all([envs[number] for number in running], [actions[number] for number in running])
            for number, step in zip(running, steps, strict=True):
                advance(self.interface, episodes[number], envs[number], actions[number], step)
                if len(episodes[number]) == self._horizon and envs[number].agents:
                    raise ValueError(f"an episode goes on after horizon={self._horizon} steps; give a longer horizon")
            self.steps += len(running)
        return episodes

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()

    def _choose(
        self, player: Player, episodes: list[Episode], running: list[int], choose: Choose, rng: np.random.Generator
    ) -> dict[int, dict[str, int]]:
        """Return episode -> agent -> its action, for the agents that are there."""
        chosen: dict[int, dict[str, int]] = {number: {} for number in running}
        for name in self.interface.agents:
            there = [number for number in running if name in self.envs[number].agents]
            if not there:
                continue
            index = torch.tensor(there)
            seen = tensors(stack([episodes[number].observations[-1][name] for number in there]))
            legal = np.stack([episodes[number].legal[-1][name] for number in there])
            labels = np.array([episodes[number].label(name) for number in there])
            actions = choose(player.values(name, index, seen), torch.from_numpy(legal), labels, rng)
            player.remember(name, index, torch.from_numpy(actions))
            for number, action in zip(there, actions, strict=True):
                chosen[number][name] = int(action)
        return chosen


def begin(interface: Interface, env: Any, start: tuple) -> Episode:
    """Return the episode that begins with what an environment's reset has returned."""
    episode = Episode()
    _look(interface, episode, env, *start)
    return episode


def advance(interface: Interface, episode: Episode, env: Any, actions: dict[str, int], step: tuple) -> None:
    """Record a step, which has returned five things."""
    names = interface.agents
    observations, rewards, terminated, _, infos = step
    episode.actions.append({name: actions.get(name, 0) for name in names})
    episode.rewards.append(np.array([rewards.get(name, 0.0) for name in names], np.float32))
    episode.acted.append(np.array([name in actions for name in names]))
    episode.terminated.append(np.array([bool(terminated.get(name, False)) for name in names]))
    _look(interface, episode, env, observations, infos)


def _look(
    interface: Interface, episode: Episode, env: Any, observations: dict[str, Any], infos: dict[str, Any]
) -> None:
    seen = {name: over(np.array, observation) for name, observation in observations.items()}  # envs may reuse theirs
    nothing = {name: zeros(space) for name, space in interface.observations.items() if name not in seen}
    episode.observations.append({name: {**seen, **nothing}[name] for name in interface.agents})
    episode.states.append(interface.state(env, observations))
    episode.legal.append({name: _legal(infos.get(name, {}), count) for name, count in interface.actions.items()})
    episode.info = infos


def _legal(info: dict[str, Any], count: int) -> np.ndarray:
    """Return which actions the environment allows: ``info["action_mask"]``, or all."""
    mask = np.asarray(info.get("action_mask", np.ones(count)), dtype=bool)
    return mask if mask.any() else np.ones(count, dtype=bool)
