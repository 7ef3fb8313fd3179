"""Some environments of a vector, stepped one after the other."""

import mmap
import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.vector.infos import Change, ChangeFinder
from chmarl_pb.envs.vector.memory import Memory, Signature, Spaces
from chmarl_pb.errors import NotResetError

MakeEnv = Callable[[], gymnasium.Env]

_KNOWN = ("gymnasium", "chmarl_pb")  # packages whose wrappers and environments do not look into physics in a step
_EVERY = 0.001  # seconds between parts of an answer: who gathers them does so while other environments are stepped


class PartialAnswer(NamedTuple):
    """A part of the answer to a reset or a step.

    Attributes:
        numbers: of the environments that it is of, in their order.
        changes: how the info of each has changed; all else that they answer is in the memory.
    """

    numbers: list[int]
    changes: list[Change]


class Batch:
    """Environments with consecutive numbers, and their rows of the memory.

    The methods ``reset`` and ``step`` answer in parts, as environments are ready; ``call`` and the like with one entry
    for each environment.
    """

    def __init__(self, make: MakeEnv, numbers: range, autoreset: AutoresetMode):
        """Make environments.

        Args:
            make: makes one of them.
            numbers: theirs in the vector.
            autoreset: when one whose episode is over is reset.
        """
        self.numbers, self.autoreset = numbers, autoreset
        self.envs: list[gymnasium.Env] = []
        try:
            self.envs.extend(make() for _ in numbers)
        except BaseException:
            self.close()
            raise
        for env in self.envs:
            _let_physics_wait(env)
        first = self.envs[0]
        self.signature = Signature(
            first.observation_space, first.action_space, dict(first.metadata), first.render_mode,
            None if first.spec is None else first.spec.max_episode_steps,
        )  # fmt: skip
        self._over = [False for _ in numbers]
        self._finders = [ChangeFinder() for _ in numbers]

    def start(self) -> list[Spaces]:
        """Return the spaces of the environments, which have been made."""
        return [(env.observation_space, env.action_space) for env in self.envs]

    def share(self, memory: Memory) -> None:
        """Read and write this memory from now on."""
        self.memory = memory
        self._rows = [
            {key: array[number, ...] for key, array in memory.observations.items()} for number in self.numbers
        ]

    def share_file(self, path: str, count: int) -> list[None]:
        """Read and write the memory of a vector of ``count`` environments that a file holds."""
        with open(path, "r+b") as file:
            self.share(Memory(self.signature, count, mmap.mmap(file.fileno(), 0)))
        return []

    def reset(
        self,
        seeds: Sequence[int | None],
        options: Sequence[Any],
        mask: np.ndarray | None,
        chosen: Sequence[int] | None = None,
    ) -> Iterator[PartialAnswer]:
        """Reset the environments, or those that a mask names.

        Args:
            seeds: one for each environment of the vector.
            options: one for each environment of the vector.
            mask: (count,) bool; the infos of the others are empty.
            chosen: numbers of those that answer; None: all.
        """

        def begin(index: int) -> dict[str, Any]:
            number = self.numbers[index]
            if mask is not None and not mask[number]:
                return {}
            observation, info = self.envs[index].reset(seed=seeds[number], options=options[number])
            self._write(index, observation, 0.0, False, False)
            return info

        return self._in_parts(begin, chosen)

    def step(self, chosen: Sequence[int] | None = None) -> Iterator[PartialAnswer]:
        """Step environments, all if none are chosen, by their actions in the memory; reset those that are due."""
        return self._in_parts(self._step, chosen)

    def _in_parts(self, act: Callable[[int], dict[str, Any]], chosen: Sequence[int] | None) -> Iterator[PartialAnswer]:
        """Let environments act one after the other, and yield what has been done once in a while."""
        part, end = PartialAnswer([], []), time.perf_counter() + _EVERY
        for number in self.numbers if chosen is None else chosen:
            index = number - self.numbers.start
            change = self._finders[index].change(act(index))
            part.numbers.append(number)
            part.changes.append(change)
            if time.perf_counter() >= end:
                yield part
                part, end = PartialAnswer([], []), time.perf_counter() + _EVERY
        if part.numbers:
            yield part

    def _step(self, index: int) -> dict[str, Any]:
        env = self.envs[index]
        if self._over[index] and self.autoreset is AutoresetMode.DISABLED:
            raise NotResetError(f"step() of environment {self.numbers[index]} after its episode; reset it first")
        if self._over[index] and self.autoreset is AutoresetMode.NEXT_STEP:
            observation, info = env.reset()
            self._write(index, observation, 0.0, False, False)
            return info
        action = self.memory.actions[self.numbers[index]]
        observation, reward, terminated, truncated, info = env.step(action)
        if (terminated or truncated) and self.autoreset is AutoresetMode.SAME_STEP:
            final = {"final_obs": observation, "final_info": info}
            observation, info = env.reset()
            info = {**final, **info}
        self._write(index, observation, float(reward), terminated, truncated)
        return info

    def _write(self, index: int, observation: Any, reward: float, terminated: bool, truncated: bool) -> None:
        values = observation if isinstance(observation, dict) else {"": observation}
        for key, row in self._rows[index].items():
            row[...] = values[key]
        number, memory = self.numbers[index], self.memory
        memory.rewards[number], memory.terminated[number], memory.truncated[number] = reward, terminated, truncated
        self._over[index] = terminated or truncated

    def call(self, chosen: Sequence[int], name: str, args: tuple[Any, ...], kwargs: dict[str, Any]) -> list[Any]:
        """Call a method of the chosen environments, or read an attribute."""
        return [value(*args, **kwargs) if callable(value) else value for value in self.get(chosen, name)]

    def get(self, chosen: Sequence[int], name: str) -> list[Any]:
        """Read an attribute of the chosen environments."""
        return [env.get_wrapper_attr(name) for env in self._chosen(chosen)]

    def has(self, chosen: Sequence[int], name: str) -> list[bool]:
        """Return whether the chosen environments have an attribute."""
        return [env.has_wrapper_attr(name) for env in self._chosen(chosen)]

    def set(self, chosen: Sequence[int], name: str, values: Sequence[Any]) -> list[None]:
        """Set an attribute of the chosen environments; there is a value for each one of the vector."""
        for number in self._mine(chosen):
            self.envs[number - self.numbers.start].set_wrapper_attr(name, values[number])
        return [None for _ in self._mine(chosen)]

    def wrapped(self, chosen: Sequence[int], wrapper: str) -> list[bool]:
        """Return whether the chosen environments are wrapped by a class, told by its full name.

        A name, not the class: to ask for one of Stable-Baselines3 must not import PyTorch here.
        """
        return [wrapper in map(full_name, _classes(env)) for env in self._chosen(chosen)]

    def close(self) -> None:
        """Close the environments."""
        for env in self.envs:
            env.close()
        self.envs = []

    def _chosen(self, chosen: Sequence[int]) -> list[gymnasium.Env]:
        """Return environments for somebody to look into: PyBullet's bodies are where they are in the state."""
        envs = [self.envs[number - self.numbers.start] for number in self._mine(chosen)]
        for env in envs:
            _sync_physics(env)
        return envs

    def _mine(self, chosen: Sequence[int]) -> list[int]:
        return [number for number in chosen if number in self.numbers]


def _let_physics_wait(env: gymnasium.Env) -> None:
    """Let bodies be moved only when somebody looks, if nobody can in a step: a user's wrapper might.

    To move a few in each of 32 clients, which do not fit the processor's cache, took near a third of a vector's time.
    """
    kinds = [type(one) for one in _layers(env)]
    household = getattr(env.unwrapped, "parallel", None)
    if type(household) is HouseholdEnv and all(kind.__module__.split(".")[0] in _KNOWN for kind in kinds):
        household.physics_follows = False


def _sync_physics(env: gymnasium.Env) -> None:
    """Bring the bodies of an environment whose physics waits to where they are in the state."""
    household = getattr(env.unwrapped, "parallel", None)
    if type(household) is HouseholdEnv:
        household.world.sync()


def full_name(kind: type) -> str:
    """Return the name of a class with that of its module."""
    return f"{kind.__module__}.{kind.__qualname__}"


def _layers(env: gymnasium.Env) -> Iterator[gymnasium.Env]:
    """Yield the wrappers of an environment, the outermost first, and the environment itself."""
    while isinstance(env, gymnasium.Wrapper):
        yield env
        env = env.env
    yield env


def _classes(env: gymnasium.Env) -> Iterator[type]:
    """Yield the classes of all wrappers of an environment, with their bases."""
    for wrapper in _layers(env):
        if isinstance(wrapper, gymnasium.Wrapper):
            yield from type(wrapper).__mro__
