"""Play one episode of a data set and put all that is stored of it into arrays."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Protocol, Union

import gymnasium
import numpy as np

import chmarl_pb  # noqa: F401  (registers the Gymnasium ids)
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import Episode, rollout
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy, core_of
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.replay import ReplayPolicy
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.splits import split_of
from chmarl_pb.tasks.task import Task

Arrays = dict[str, Union[np.ndarray, "Arrays"]]


class Labelled(Policy, Protocol):
    """A policy that notes what the planner would do in every state.

    Attributes:
        labels: the planner's actions, one for each state since the reset.
    """

    labels: list[Actions]


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


class Repeated:
    """Repeats actions that were stored, and notes what the planner would do in every state.

    Attributes:
        labels: the planner's actions, one for each state since the reset.
    """

    def __init__(self, env: HouseholdEnv, actions: np.ndarray):
        """Repeat actions (T, robots) in an environment."""
        self._planner, self._replay = make_policy("planner", env), ReplayPolicy(actions.tolist(), env)
        self.labels: list[Actions] = []

    def reset(self, seed: int | None) -> None:
        """Plan the episode that has just begun."""
        self._planner.reset(seed)
        self._replay.reset(seed)
        self.labels = []

    def act(self, observations: Observations, infos: Infos) -> Actions:
        """Return the next of the actions."""
        self.labels.append(self._planner.act(observations, infos))
        return self._replay.act(observations, infos)


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
    given = {"robots": None if recipe.robots == TEAM else recipe.robots, "home": recipe.home, "catalog": recipe.catalog}
    options: dict[str, Any] = {name: value for name, value in given.items() if value is not None}
    return gymnasium.make(recipe.env_id, split=recipe.split, disable_env_checker=True, **options)


def record(env: gymnasium.Env, policy: Labelled, task: Task) -> Recording:
    """Play one task and return what is stored of it."""
    episode, hashes = _played(env, policy, task)
    policy.act(episode.observations[-1], episode.infos[-1])  # the state after the last step has a label too
    return Recording(_arrays(episode, hashes, policy.labels), _metadata(episode))


def replay(env: gymnasium.Env, actions: np.ndarray, task: Task) -> Recording:
    """Repeat the stored actions (T, robots) of a task and return what would be stored."""
    return record(env, Repeated(core_of(env), actions), task)


def _played(env: gymnasium.Env, policy: Policy, task: Task) -> tuple[Episode, list[str]]:
    """Play one task; return the episode and the hash of each of its states."""
    hashes: list[str] = []
    episode = rollout(core_of(env), policy, task.seed, task, on_step=lambda env: hashes.append(state_hash(env)))
    return episode, hashes


def _arrays(episode: Episode, hashes: Sequence[str], labels: Sequence[Actions]) -> Arrays:
    steps, robots = len(episode), tuple(episode.infos[0])
    ended = np.arange(1, steps + 1) == steps
    return {
        "observations": {
            f"{robot}_{key}": np.stack([observation[robot][key] for observation in episode.observations])
            for robot in robots
            for key in episode.observations[0][robot]
        },
        "actions": _rows(episode.actions, robots),
        "rewards": episode.rewards.astype(np.float64),
        "terminations": ended & episode.success,
        "truncations": ended & (not episode.success),
        "infos": _infos(episode, hashes, labels),
    }


def _infos(episode: Episode, hashes: Sequence[str], labels: Sequence[Actions]) -> Arrays:
    robots = tuple(episode.infos[0])
    shared = [info[robots[0]] for info in episode.infos]
    infos: Arrays = {"state_hash": _texts(hashes), "planner_action": _rows(labels, robots)}
    infos["potential"] = np.array([info["potential"] for info in shared], dtype=np.float64)
    infos["instruction"] = _texts([info["instruction"] for info in shared])
    for robot in robots:
        own = [info[robot] for info in episode.infos]
        infos[robot] = {
            "feedback": _texts([info["feedback"] for info in own]),
            "visible": _texts([" ".join(info["visible"]) for info in own]),
            "action_success": np.array([info["action_success"] for info in own], dtype=bool),
        }
    return infos


def _metadata(episode: Episode) -> dict[str, Any]:
    task, (first, *_) = episode.task, episode.infos[0].values()
    fields = {f"options/task/{name}": value for name, value in asdict(task).items()}
    return {
        "total_steps": len(episode),
        "seed": task.seed,
        **({"options/task": task.id} if split_of(task.id) else fields),  # nobody finds a drawn one by its id
        "home": task.home,
        "graspable": task.graspable,
        "source": task.source,
        "target": task.target,
        "optimal_steps": task.optimal_steps,
        "success": episode.success,
        "instruction": first["instruction"],
    }


def _rows(actions: Sequence[Actions], robots: Sequence[str]) -> np.ndarray:
    return np.array([[action[robot] for robot in robots] for action in actions], dtype=np.int64)


def _texts(texts: Sequence[str]) -> np.ndarray:
    """Return ASCII texts as bytes of a fixed length, which HDF5 packs well."""
    return np.array([text.encode("ascii") for text in texts])
