"""The speed of vectors: one process against two, in lockstep, asynchronous and apart; ours beside Gymnasium's."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from functools import partial
from itertools import cycle
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiDiscrete, Space
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, VectorEnv

import chmarl_pb
from chmarl_pb.bench.playing import SPLIT, Effort, Samples, per_second, scouted_poses, warm_up
from chmarl_pb.envs.parallel import HouseholdEnv

_SHARED = 32  # environments of one vector on one and on two processes
_BESIDE = 8  # environments of our vector and of Gymnasium's
_IDS = {"scene_graph": "CHMARL/SceneGraph-v0", "visual": "CHMARL/Visual-v0"}


def processes(effort: Effort, observation: str) -> Samples:
    """Yield joint steps a second of one vector of environments, resets included, on one and on two processes.

    Two are in lockstep, or answer the first half of the environments that is ready. What two processes reach that never
    wait for each other tells what the machine gives.
    """
    with closing(HouseholdEnv(observation, split=SPLIT)) as env:
        warm_up(env, scouted_poses(effort.warm_up))
    makes: dict[str, Callable[[], RandomVector | RandomBatches | ApartVectors]] = {
        "1 process": partial(our_vector, _SHARED, 1, observation),
        "2 processes": partial(our_vector, _SHARED, 2, observation),
        "2 processes asynchronous": partial(RandomBatches, _SHARED, 2, observation),
        "2 processes apart": partial(ApartVectors, _SHARED, 2, observation),
    }
    with ExitStack() as stack:
        rates = {}
        for name, make in makes.items():
            envs = make()
            stack.callback(envs.close)
            per_second(envs.step, 30 * effort.seconds)  # each process gets to know views and layouts by itself
            rates[name] = partial(per_second, envs.step, effort.seconds, envs.steps)
        while True:
            taken = {name: rate() for name, rate in rates.items()}
            one = taken["1 process"]
            yield {f"joint steps/s, {name}": rate for name, rate in taken.items()} | {
                f"times 1 process, {name}": taken[name] / one for name in taken if name != "1 process"
            }


def beside_gymnasium(effort: Effort, observation: str) -> Samples:
    """Yield joint steps a second of our vector and of Gymnasium's with shared memory, in turns.

    The environments, their seeds and actions are the same; ours share as many processes as there are cores, of
    Gymnasium's each has its own. An ended episode is reset in its step.
    """
    with closing(HouseholdEnv(observation, split=SPLIT)) as env:
        warm_up(env, scouted_poses(effort.warm_up))
    with ExitStack() as stack:
        theirs = AsyncVectorEnv(
            [partial(gymnasium.make, f"chmarl_pb:{_IDS[observation]}", split=SPLIT)] * _BESIDE,
            shared_memory=True, context="spawn", autoreset_mode=AutoresetMode.SAME_STEP,
        )  # fmt: skip
        vectors = {"ours": our_vector(_BESIDE, None, observation), "Gymnasium's": RandomVector(theirs)}
        for vector in vectors.values():
            stack.callback(vector.close)
            per_second(vector.step, 10 * effort.seconds)  # each process gets to know views and layouts by itself
        while True:
            taken = {name: per_second(vector.step, effort.seconds, _BESIDE) for name, vector in vectors.items()}
            yield {f"joint steps/s, {name}": rate for name, rate in taken.items()} | {
                "times Gymnasium's": taken["ours"] / taken["Gymnasium's"]
            }


def our_vector(count: int, workers: int | None, observation: str) -> "RandomVector":
    """Return environments on worker processes, see :func:`chmarl_pb.vector_env`."""
    mode = AutoresetMode.SAME_STEP
    return RandomVector(chmarl_pb.vector_env(count, _IDS[observation], workers, autoreset_mode=mode, split=SPLIT))


class RandomVector:
    """Environments in lockstep with random actions that are drawn beforehand.

    Attributes:
        steps: joint steps that a call of ``step`` takes.
    """

    def __init__(self, envs: VectorEnv):
        """Reset a vector of environments."""
        self._envs, self.steps = envs, envs.num_envs
        self.reset(seed=1)

    def reset(self, seed: int) -> None:
        """Reset all environments, and draw their actions."""
        self._actions = _random_actions(self._envs.single_action_space, self.steps, seed)
        self._envs.reset(seed=seed)

    def step(self) -> None:
        """Take one joint step in every environment."""
        self._envs.step(next(self._actions))

    def close(self) -> None:
        """Stop the processes."""
        self._envs.close()


class RandomBatches:
    """Environments that do not wait for each other, with random actions that are drawn beforehand.

    Attributes:
        steps: joint steps that a call of ``step`` takes: of half of the environments.
    """

    def __init__(self, count: int, workers: int, observation: str):
        """Let environments begin with a reset."""
        self.steps = count // 2
        self._envs = chmarl_pb.vector_env(
            count, _IDS[observation], workers, AutoresetMode.SAME_STEP, batch_size=self.steps, split=SPLIT
        )
        self._actions = _random_actions(self._envs.single_action_space, self.steps, seed=1)
        self._envs.async_reset(seed=1)

    def step(self) -> None:
        """Take the environments that are ready first, and let them go on."""
        self._envs.send(next(self._actions), self._envs.recv()[4]["env_id"])

    def close(self) -> None:
        """Stop the processes."""
        self._envs.close()


def _random_actions(space: Space[Any], count: int, seed: int) -> Iterator[np.ndarray]:
    """Return an endless stream of actions of ``count`` environments, (count, robots)."""
    assert isinstance(space, MultiDiscrete)
    return cycle(np.random.default_rng(seed).integers(space.nvec, size=(1000, count, *space.nvec.shape)))


class ApartVectors:
    """Processes with a vector each, which wait for each other only once in many steps.

    Attributes:
        steps: joint steps that a call of ``step`` takes.
    """

    def __init__(self, count: int, workers: int, observation: str):
        """Make processes that share a number of environments."""
        make = partial(_Vector, count // workers, observation)
        self._vectors = chmarl_pb.vector_env(workers, make, workers)
        self._vectors.reset(seed=1)
        self._actions = np.zeros(workers, np.int64)
        self.steps = count // workers * workers * _Vector.STEPS

    def step(self) -> None:
        """Let each process take many steps."""
        self._vectors.step(self._actions)

    def close(self) -> None:
        """Stop the processes."""
        self._vectors.close()


class _Vector(gymnasium.Env):
    """A vector of environments in this process as one environment; a step of it is many steps of theirs."""

    STEPS = 200
    observation_space = Discrete(1)
    action_space = Discrete(1)

    def __init__(self, count: int, observation: str):
        self._envs = our_vector(count, 1, observation)

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[int, dict[str, Any]]:
        super().reset(seed=seed)
        self._envs.reset(seed or 0)
        return 0, {}

    def step(self, action: int) -> tuple[int, float, bool, bool, dict[str, Any]]:
        for _ in range(self.STEPS):
            self._envs.step()
        return 0, 0.0, False, False, {}

    def close(self) -> None:
        self._envs.close()
