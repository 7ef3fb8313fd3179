"""The flat view: for every robot a vector of one shape and one number as action, so that one network acts for all."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo.utils import BaseParallelWrapper

from chmarl_pb.envs.flat_vector import FlatVector
from chmarl_pb.envs.numeric_infos import Infos, NumericInfos
from chmarl_pb.envs.options import Observed
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.words import numbers_in
from chmarl_pb.errors import ActionError, OptionError

Vectors = dict[str, np.ndarray]
Step = tuple[Vectors, dict[str, float], dict[str, bool], dict[str, bool], Infos]


class FlatEnv(BaseParallelWrapper):  # type: ignore[misc]
    """A ParallelEnv of which all robots have the same spaces, a Box and a Discrete; see :func:`flat_env`."""

    def __init__(self, env: Any, keys: Sequence[str] | None = None):
        """Wrap an environment.

        Args:
            env: a ParallelEnv of this package, or wrappers around one that leave spaces as they are.
            keys: the keys to observe; None: all.

        Raises:
            OptionError: there is no such key, or a sensor has the key ``agent``.
        """
        super().__init__(env)
        robots, core = list(env.possible_agents), env.unwrapped
        self._flat = FlatVector(env.observation_space(robots[0]), keys)
        if "agent" in self._flat.layout:
            raise OptionError("observation: a sensor has the key 'agent', which is the robot's number here; rename it")
        count, own = len(robots), self._flat.space
        self._ids = dict(zip(robots, np.eye(count, dtype=np.float32), strict=True))
        parts = {key: slice(part.start + count, part.stop + count) for key, part in self._flat.layout.items()}
        self.layout = {"agent": slice(0, count), **parts}
        low, high = np.pad(own.low, (count, 0)), np.pad(own.high, (count, 0), constant_values=1)
        self.observation_spaces = dict.fromkeys(robots, spaces.Box(low, high, dtype=np.float32))
        self._talks, self._symbols = core.symbols > 0, max(core.symbols, 1)
        self._counts = {robot: len(names) for robot, names in core.action_names.items()}
        self._stay = {robot: names.index("stay") for robot, names in core.action_names.items()}
        verbs = np.arange(max(self._counts.values()) * self._symbols) // self._symbols
        self.action_spaces = {robot: spaces.Discrete(len(verbs)) for robot in robots}
        self._masks = {robot: (verbs < count).astype(np.int8) for robot, count in self._counts.items()}

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the vector's space."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Return the space of actions, of as many as the robot with most of them has."""
        return self.action_spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Vectors, Infos]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return self._vectors(observations), self._masked(infos)

    def step(self, actions: dict[str, Any]) -> Step:
        """Let all robots act once.

        Args:
            actions: robot -> number; one that its robot does not have is stay.

        Raises:
            ActionError: an action is missing, or not in the action space.
        """
        if isinstance(actions, dict):  # the environment refuses what is none, and names that are no robots
            actions = {robot: self._own(robot, action) for robot, action in actions.items()}
        observations, rewards, terminations, truncations, infos = self.env.step(actions)
        return self._vectors(observations), rewards, terminations, truncations, self._masked(infos)

    def _own(self, robot: str, action: Any) -> Any:
        if robot not in self._ids:
            return action
        number, most = numbers_in(robot, action), int(self.action_spaces[robot].n)
        if number.size != 1 or number.dtype.kind not in "iu" or not 0 <= int(number.item()) < most:
            raise ActionError(f"{robot}: action {action!r} is not a whole number from 0 to {most - 1}")
        verb, symbol = divmod(int(number.item()), self._symbols)
        verb = verb if verb < self._counts[robot] else self._stay[robot]
        return (verb, symbol) if self._talks else verb

    def _vectors(self, observations: dict[str, Any]) -> Vectors:
        return {robot: np.append(self._ids[robot], self._flat(seen)) for robot, seen in observations.items()}

    def _masked(self, infos: Infos) -> Infos:
        return {robot: {**info, "action_mask": self._masks[robot].copy()} for robot, info in infos.items()}


def flat_env(observation: Observed = "scene_graph", keys: Sequence[str] | None = None, **options: Any) -> FlatEnv:
    """Return the ParallelEnv with vectors as observations, one number as action, and infos without text.

    **Observation**: (length,) float32 from -1 to 1, of one length for all robots: first which robot this is, one-hot,
    then the keys in the order of the alphabet, each flattened and divided by the largest value of its space.
    ``env.layout`` names the slices.
    **Action**: one number, of as many for all robots; what a robot does not have counts as its last action, stay. With
    own words the number is ``action * symbols + symbol``.
    **Info**: numbers only; ``action_mask`` is int8, 1 for the actions that the robot has.

    >>> env = chmarl_pb.flat_env(split="val-unseen")
    >>> observations, infos = env.reset(seed=0)
    >>> observations["drone"].shape, observations["drone"][env.layout["agent"]].tolist()
    ((842,), [0.0, 1.0])
    >>> infos["drone"]["action_mask"]
    array([1, 1, 1, 1, 1, 1, 1, 1, 1, 0], dtype=int8)
    >>> env.close()

    Args:
        observation: see :func:`chmarl_pb.parallel_env`.
        keys: the keys to observe, e.g. ``("goal", "messages", "self")``; None: all.
        **options: see :class:`chmarl_pb.envs.options.Options`.

    Raises:
        OptionError, HomeError: as of :func:`chmarl_pb.parallel_env`; or there is no such key.
    """
    return FlatEnv(NumericInfos(HouseholdEnv(observation, **options)), keys)
