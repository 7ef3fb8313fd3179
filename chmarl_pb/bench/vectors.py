"""The speed of vectors of environments: one process against two, in lockstep and apart."""

from collections.abc import Callable
from contextlib import ExitStack, closing
from functools import partial
from itertools import cycle
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Discrete, MultiDiscrete
from gymnasium.vector import AutoresetMode

import chmarl_pb
from chmarl_pb.bench.playing import SPLIT, Effort, Samples, per_second, scouted_poses, warm_up
from chmarl_pb.envs.parallel import HouseholdEnv

_IDS = {"scene_graph": "CHMARL/SceneGraph-v0", "visual": "CHMARL/Visual-v0"}


def processes(effort: Effort, observation: str, count: int = 32) -> Samples:
    """Yield joint steps a second of one vector of environments, resets included, on one and on two processes.

    What two processes reach that need not wait for each other tells what the machine gives.
    """
    with closing(HouseholdEnv(observation, split=SPLIT)) as env:
        warm_up(env, scouted_poses(effort.warm_up))
    makes: dict[str, Callable[[], RandomVector | ApartVectors]] = {
        "1 process": partial(RandomVector, count, 1, observation),
        "2 processes": partial(RandomVector, count, 2, observation),
        "2 processes apart": partial(ApartVectors, count, 2, observation),
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


class RandomVector:
    """Environments in lockstep with random actions that are drawn beforehand; an ended episode is reset in its step.

    Attributes:
        steps: joint steps that a call of ``step`` takes.
    """

    def __init__(self, count: int, workers: int, observation: str):
        """Make environments on worker processes, see :func:`chmarl_pb.vector_env`, and reset them."""
        mode = AutoresetMode.SAME_STEP
        self._envs = chmarl_pb.vector_env(count, _IDS[observation], workers, autoreset_mode=mode, split=SPLIT)
        self.steps = count
        self.reset(seed=1)

    def reset(self, seed: int) -> None:
        """Reset all environments, and draw their actions."""
        space = self._envs.single_action_space
        assert isinstance(space, MultiDiscrete)
        shape = (1000, self.steps, *space.nvec.shape)
        self._actions = cycle(np.random.default_rng(seed).integers(space.nvec, size=shape))
        self._envs.reset(seed=seed)

    def step(self) -> None:
        """Take one joint step in every environment."""
        self._envs.step(next(self._actions))

    def close(self) -> None:
        """Stop the processes."""
        self._envs.close()


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
        self._envs = RandomVector(count, 1, observation)

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
