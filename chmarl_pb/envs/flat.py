"""The flat view: for every robot a vector of one shape and one number as action, so that one network acts for all."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from gymnasium import spaces
from pettingzoo.utils import BaseParallelWrapper

from chmarl_pb.envs.flat_vector import FlatVector
from chmarl_pb.envs.numeric_infos import Infos, NumericInfos
from chmarl_pb.envs.options import Observed
from chmarl_pb.envs.parallel import HouseholdEnv, Results
from chmarl_pb.errors import ActionError


class FlatEnv(BaseParallelWrapper):  # type: ignore[misc]
    """A ParallelEnv of which all robots have the same spaces: a Box and a Discrete; see :func:`flat_env`.

    Attributes:
        layout: key -> slice of the vector that it fills; ``agent`` is the robot's own number as one-hot.
        observation_spaces: robot -> space of its vector, float32.
        action_spaces: robot -> space of its action.
    """

    def __init__(self, env: Any, keys: Sequence[str] | None = None):
        """Wrap an environment.

        Args:
            env: a ParallelEnv of this package, or wrappers around one that leave spaces as they are.
            keys: the keys to observe; None: all.

        Raises:
            OptionError: there is no such key.
        """
        super().__init__(env)
        robots = list(env.possible_agents)
        self._flat = FlatVector(env.observation_space(robots[0]), keys)
        self._ids = dict(zip(robots, np.eye(len(robots), dtype=np.float32), strict=True))
        count = len(robots)
        own = {key: slice(part.start + count, part.stop + count) for key, part in self._flat.layout.items()}
        self.layout = {"agent": slice(0, count), **own}
        low, high = self._flat.space.low, self._flat.space.high
        no, yes = np.zeros(count, np.float32), np.ones(count, np.float32)
        box = spaces.Box(np.append(no, low), np.append(yes, high), dtype=np.float32)
        core = env.unwrapped
        self._counts = {robot: len(names) for robot, names in core.action_names.items()}
        self._symbols = core.symbols
        number = max(self._counts.values()) * max(self._symbols, 1)
        self.observation_spaces = dict.fromkeys(robots, box)
        self.action_spaces = {robot: spaces.Discrete(number) for robot in robots}
        self._masks = {
            robot: (np.arange(number) // max(self._symbols, 1) < own).astype(np.int8)
            for robot, own in self._counts.items()
        }

    def observation_space(self, agent: str) -> spaces.Box:
        """Return the vector's space."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Discrete:
        """Return the space of actions, of as many as the robot with most of them has."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], Infos]:
        """Start an episode; see :meth:`HouseholdEnv.reset`."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return self._vectors(observations), self._masked(infos)

    def step(self, actions: dict[str, Any]) -> Results:
        """Let all robots act once.

        Args:
            actions: robot -> number; one that its robot does not have is its last, stay.

        Raises:
            ActionError: an action is missing, or not in the action space.
        """
        own = {robot: self._own(robot, action) for robot, action in actions.items() if robot in self._ids}
        observations, rewards, terminations, truncations, infos = self.env.step(own)
        return self._vectors(observations), rewards, terminations, truncations, self._masked(infos)

    def _own(self, robot: str, action: Any) -> Any:
        """Return the action as the robot itself has it."""
        number, most = np.asarray(action), int(self.action_spaces[robot].n)
        if number.size != 1 or number.dtype.kind not in "iu" or not 0 <= int(number.item()) < most:
            raise ActionError(f"{robot}: action {action!r} is not a whole number from 0 to {most - 1}")
        verb, symbol = divmod(int(number.item()), max(self._symbols, 1))
        verb = min(verb, self._counts[robot] - 1)
        return (verb, symbol) if self._symbols else verb

    def _vectors(self, observations: dict[str, Any]) -> dict[str, Any]:
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
    >>> infos["drone"]["action_mask"].tolist()
    [1, 1, 1, 1, 1, 1, 1, 1, 1, 0]
    >>> env.close()

    Args:
        observation: see :func:`chmarl_pb.parallel_env`.
        keys: the keys to observe, e.g. ``("goal", "messages", "self")``; None: all.
        **options: see :class:`chmarl_pb.envs.options.Options`.

    Raises:
        OptionError: an option has a value that it does not know, or there is no such key.
        HomeError: a home cannot be used.
    """
    return FlatEnv(NumericInfos(HouseholdEnv(observation, **options)), keys)
