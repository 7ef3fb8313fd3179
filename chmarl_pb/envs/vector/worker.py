"""Some environments of a vector, stepped one after the other; the whole of what a worker process does."""

import mmap
import os
import pickle
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import closing
from dataclasses import dataclass
from multiprocessing.connection import Connection
from select import POLLIN, poll
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Dict, Space
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import CloudpickleWrapper

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.vector.infos import Change, ChangeFinder
from chmarl_pb.errors import NotResetError, OptionError
from chmarl_pb.processes import begin

MakeEnv = Callable[[], gymnasium.Env]

_KNOWN = ("gymnasium", "chmarl_pb")  # packages whose wrappers and environments do not look into physics in a step
_WATCH = 0.002  # seconds: most vector steps are shorter, and to wake a sleeping process takes a tenth of one


@dataclass(frozen=True)
class Signature:
    """What each of the environments is like."""

    observation_space: Space[Any]
    action_space: Space[Any]
    metadata: dict[str, Any]
    render_mode: str | None


class Memory:
    """What the environments of a vector read and write: arrays with one row for each of them.

    Attributes:
        observations: key -> (count, ...); the key is "" if observations are no dictionaries.
        actions: (count, ...).
        rewards: (count,) float64.
        terminated: (count,) bool.
        truncated: (count,) bool.
    """

    def __init__(self, signature: Signature, count: int, buffer: mmap.mmap | None = None):
        """Lay the arrays out in a buffer that other processes may share, or in memory of this process alone."""
        layout = Memory.layout(signature, count)
        whole = np.zeros((), layout) if buffer is None else np.ndarray((), layout, buffer)
        self.observations = {key: whole[f"observation {key}"] for key in _parts(signature.observation_space)}
        self.actions, self.rewards = whole["actions"], whole["rewards"]
        self.terminated, self.truncated = whole["terminated"], whole["truncated"]

    @staticmethod
    def layout(signature: Signature, count: int) -> np.dtype:
        """Return the arrays as one structured type; its ``itemsize`` is the size of the memory in bytes."""
        parts = {f"observation {key}": part for key, part in _parts(signature.observation_space).items()}
        parts["actions"] = signature.action_space
        fields = [(name, part.dtype, (count, *(part.shape or ()))) for name, part in parts.items()]
        fields += [("rewards", np.dtype(np.float64), (count,))]
        fields += [(name, np.dtype(np.bool_), (count,)) for name in ("terminated", "truncated")]
        return np.dtype(fields, align=True)


class Batch:
    """Environments with consecutive numbers, and their rows of the memory.

    The methods ``reset``, ``step``, ``call`` and the like answer with one entry for each environment.
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
        self.signature = Signature(first.observation_space, first.action_space, dict(first.metadata), first.render_mode)
        self._over = [False for _ in numbers]
        self._finders = [ChangeFinder() for _ in numbers]

    def start(self) -> list[None]:
        """Do nothing; the answer tells that the environments have been made."""
        return []

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

    def reset(self, seeds: Sequence[int | None], options: Sequence[Any], mask: np.ndarray | None) -> list[Change]:
        """Reset the environments, or those that a mask names; arguments have an entry for each one of the vector."""
        changes = []
        for index, number in enumerate(self.numbers):
            info: dict[str, Any] = {}
            if mask is None or mask[number]:
                observation, info = self.envs[index].reset(seed=seeds[number], options=options[number])
                self._write(index, observation, 0.0, False, False)
            changes.append(self._finders[index].change(info))
        return changes

    def step(self) -> list[Change]:
        """Step each environment by its action in the memory, or reset it if that is due."""
        return [self._finders[index].change(self._step(index)) for index in range(len(self.envs))]

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
            _let_physics_follow(env)
        return envs

    def _mine(self, chosen: Sequence[int]) -> list[int]:
        return [number for number in chosen if number in self.numbers]


@dataclass(frozen=True)
class Failure:
    """What went wrong in a worker: the exception and the text of its traceback."""

    error: Exception
    trace: str


def serve(
    commands: Connection, answers: Connection, make: CloudpickleWrapper, numbers: range, autoreset: AutoresetMode
) -> None:
    """Answer commands until the parent has closed its ends of the pipes, be it on purpose or by its death.

    Args:
        commands: from the parent: a method of :class:`Batch` and its arguments, pickled.
        answers: to the parent: what the method returns or a :class:`Failure`, pickled; the first one, that
            of ``start``, comes unasked.
        make: makes an environment.
        numbers: of this worker's environments.
        autoreset: when an environment whose episode is over is reset.
    """
    begin()
    try:
        try:
            batch = Batch(make.fn, numbers, autoreset)
        except Exception as error:
            answers.send(failure(error))
            return
        with closing(batch):
            answers.send(batch.start())
            while True:
                command, arguments = pickle.loads(listen(commands))
                answers.send_bytes(_answer(batch, command, arguments))
    except (EOFError, ConnectionError):
        return


def listen(pipe: Connection) -> bytes:
    """Return the next message; watch the pipe for a moment before going to sleep, as messages come in quick turns.

    Raises:
        EOFError: the other end was closed.
    """
    watch, end = poll(), time.perf_counter() + _WATCH
    watch.register(pipe.fileno(), POLLIN)
    while not watch.poll(0) and time.perf_counter() < end:
        os.sched_yield()
    return pipe.recv_bytes()


def _answer(batch: Batch, command: str, arguments: tuple[Any, ...]) -> bytes:
    try:
        return pickle.dumps(getattr(batch, command)(*arguments), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return pickle.dumps(failure(error))


def failure(error: Exception) -> Failure:
    """Return an error with its traceback; one that cannot travel becomes a RuntimeError with its text."""
    trace = traceback.format_exc()
    try:
        pickle.loads(pickle.dumps(error))
    except Exception:
        error = RuntimeError(f"{type(error).__name__}: {error}")
    return Failure(error, trace)


def _let_physics_wait(env: gymnasium.Env) -> None:
    """Let bodies be moved only when somebody looks, if nobody can in a step: a user's wrapper might.

    To move a few in each of 32 clients, which do not fit the processor's cache, took near a third of a vector's time.
    """
    kinds = [type(one) for one in _layers(env)]
    household = getattr(env.unwrapped, "parallel", None)
    if type(household) is HouseholdEnv and all(kind.__module__.split(".")[0] in _KNOWN for kind in kinds):
        household.physics_follows = False


def _let_physics_follow(env: gymnasium.Env) -> None:
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


def _parts(space: Space[Any]) -> dict[str, Space[Any]]:
    """Return key -> space of the arrays that an observation consists of.

    Raises:
        OptionError: it is neither an array nor a flat dictionary of arrays.
    """
    parts = dict(space.spaces) if isinstance(space, Dict) else {"": space}
    for key, part in parts.items():
        if part.shape is None or part.dtype is None:
            raise OptionError(f"observation {key}: {part} is not an array of one shape; flatten it by a wrapper")
    return parts
