"""Play one episode of a data set and put all that is stored of it into arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol, Union

import gymnasium
import numpy as np

import chmarl_pb  # noqa: F401  (registers the Gymnasium ids)
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.envs.parallel import AGENTS, HouseholdEnv
from chmarl_pb.envs.rollout import Episode, rollout
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.policies.policy import Actions, Infos, Observations, core_of
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.tasks.task import Task

Arrays = dict[str, Union[np.ndarray, "Arrays"]]


class Driver(Protocol):
    """A policy whose labels can be asked for."""

    labels: list[Actions]

    def reset(self, seed: int | None) -> None:
        """Begin an episode."""

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return robot -> number of its action, and note a label."""


class NoisyPlanner:
    """The planner, but each robot now and then acts at random; notes what the planner would do in every state.

    Attributes:
        labels: the planner's actions, one for each state since the reset.
    """

    def __init__(self, env: HouseholdEnv, noise: float, seed: int):
        """Drive an environment.

        Args:
            env: the environment.
            noise: probability of a random action, for each robot and step.
            seed: of the random actions; an episode's own seed is added to it.
        """
        self._planner = make_policy("planner", env)
        self._counts = {robot: len(names) for robot, names in env.action_names.items()}
        self._noise, self._seed = noise, seed
        self.labels: list[Actions] = []

    def reset(self, seed: int | None) -> None:
        """Plan the episode that has just begun."""
        self._planner.reset(seed)
        self._rng = np.random.default_rng([self._seed, seed or 0])
        self.labels = []

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the planner's action of each robot, or a random one."""
        self.labels.append(self._planner.act(observations, infos))
        return {
            robot: int(self._rng.integers(self._counts[robot])) if self._rng.random() < self._noise else action
            for robot, action in self.labels[-1].items()
        }


class Replayer:
    """Repeats stored actions.

    Attributes:
        labels: the actions themselves.
    """

    def __init__(self, actions: np.ndarray):
        """Repeat actions (T, 2)."""
        self._actions = actions
        self.labels: list[Actions] = []

    def reset(self, seed: int | None) -> None:
        """Start from the first action."""
        self.labels = []

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the next action; after the last one, both robots' first action."""
        number = len(self.labels)
        row = self._actions[number] if number < len(self._actions) else np.zeros(len(AGENTS), dtype=np.int64)
        self.labels.append({robot: int(action) for robot, action in zip(AGENTS, row, strict=True)})
        return self.labels[-1]


@dataclass(frozen=True, eq=False)
class Recording:
    """One episode as it is stored; T is its number of steps.

    Attributes:
        arrays: ``observations`` (T + 1), ``actions``, ``rewards``, ``terminations``, ``truncations`` (T), ``infos``
            (T + 1).
        metadata: facts of the whole episode.
    """

    arrays: Arrays
    metadata: dict[str, Any]


def make_env(recipe: Recipe) -> gymnasium.Env:
    """Return the joint environment that a data set is recorded in."""
    return gymnasium.make(recipe.env_id, split=recipe.split, disable_env_checker=True)


def record(env: gymnasium.Env, driver: Driver, task: Task) -> Recording:
    """Play one task and return what is stored of it."""
    noting = _Noting(core_of(env), driver)
    episode = rollout(noting.env, noting, task.seed, task)
    noting.act(episode.observations[-1], episode.infos[-1])  # the state after the last step has hash and label too
    return Recording(_arrays(episode, driver.labels, noting.hashes), _metadata(episode))


class _Noting:
    """A driver that notes the state's hash whenever it is asked to act."""

    def __init__(self, env: HouseholdEnv, driver: Driver):
        self.env, self._driver = env, driver
        self.hashes: list[str] = []

    def reset(self, seed: int | None) -> None:
        self._driver.reset(seed)
        self.hashes = []

    def act(self, observations: Observations, infos: Infos) -> Actions:
        self.hashes.append(state_hash(self.env))
        return self._driver.act(observations, infos)


def _arrays(episode: Episode, labels: Sequence[Actions], hashes: Sequence[str]) -> Arrays:
    steps = len(episode)
    ended = np.arange(1, steps + 1) == steps
    return {
        "observations": {
            f"{robot}_{key}": np.stack([observation[robot][key] for observation in episode.observations])
            for robot in AGENTS
            for key in episode.observations[0][robot]
        },
        "actions": _pairs(episode.actions),
        "rewards": episode.rewards.astype(np.float64),
        "terminations": ended & episode.success,
        "truncations": ended & (not episode.success),
        "infos": _infos(episode, labels, hashes),
    }


def _infos(episode: Episode, labels: Sequence[Actions], hashes: Sequence[str]) -> Arrays:
    shared = [info[AGENTS[0]] for info in episode.infos]
    infos: Arrays = {
        "state_hash": _texts(hashes),
        "planner_action": _pairs(labels),
        "potential": np.array([info["potential"] for info in shared], dtype=np.float64),
        "instruction": _texts([info["instruction"] for info in shared]),
    }
    for robot in AGENTS:
        own = [info[robot] for info in episode.infos]
        infos[robot] = {
            "feedback": _texts([info["feedback"] for info in own]),
            "visible": _texts([" ".join(info["visible"]) for info in own]),
            "action_success": np.array([info["action_success"] for info in own], dtype=bool),
        }
    return infos


def _metadata(episode: Episode) -> dict[str, Any]:
    task = episode.task
    return {
        "total_steps": len(episode),
        "seed": task.seed,
        "options/task": task.id,
        "home": task.home,
        "graspable": task.graspable,
        "source": task.source,
        "target": task.target,
        "optimal_steps": task.optimal_steps,
        "success": episode.success,
        "instruction": episode.infos[0][AGENTS[0]]["instruction"],
    }


def _pairs(actions: Sequence[Actions]) -> np.ndarray:
    return np.array([[action[robot] for robot in AGENTS] for action in actions], dtype=np.int64)


def _texts(texts: Sequence[str]) -> np.ndarray:
    """Return ASCII texts as bytes of a fixed length, which HDF5 packs well."""
    return np.array([text.encode("ascii") for text in texts])
