"""Many environments at once, as Stable-Baselines3's VecEnv: the same workers and memory as Gymnasium's view."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode

from chmarl_pb.envs.vector.batch import PartialAnswer, full_name
from chmarl_pb.envs.vector.engine import Engine, start
from chmarl_pb.envs.vector.env import check_counts, make_function
from chmarl_pb.envs.vector.exchange import gather, write_actions
from chmarl_pb.envs.vector.infos import Path, nest
from chmarl_pb.extras import needs
from chmarl_pb.world import Uncopied

with needs("sb3_vec_env", "train"):
    from stable_baselines3.common.vec_env import VecEnv

Indices = int | Iterable[int] | None
Step = tuple[Any, np.ndarray, np.ndarray, list[dict[str, Any]]]


class HouseholdVecEnv(Uncopied, VecEnv):
    """Environments of one kind, stepped together; see :func:`sb3_vec_env`."""

    _instead = "make another by sb3_vec_env(...)"

    def __init__(self, engine: Engine, count: int):
        """Join the environments of an engine that resets in the same step; the engine is closed with this."""
        self._engine = engine
        self._flat: list[dict[Path, Any]] = [{} for _ in range(count)]  # the present info of each environment
        signature = engine.signature
        super().__init__(count, signature.observation_space, signature.action_space)
        self.metadata = signature.metadata  # for VecVideoRecorder

    def seed(self, seed: int | None = None) -> Sequence[int | None]:
        """Set the seeds of the next reset: one after the other; in the endless split so far apart that homes differ."""
        first = super().seed(seed)[0] or 0
        apart = self.get_attr("episodes_in_a_home")[0] if self.has_attr("episodes_in_a_home") else 1
        self._seeds = [first + number * apart for number in range(self.num_envs)]
        return self._seeds

    def reset(self) -> Any:
        """Reset all environments by the seeds and options that were set, and return their observations."""
        if self._engine.pending:  # a step that has begun is finished for nothing, as VecEnv asks
            self._gather()
        self._engine.send("reset", self._seeds, [options or None for options in self._options], None)
        self._reset_seeds()
        self._reset_options()
        observations, self.reset_infos = self._gather()
        return observations

    def step_async(self, actions: Any) -> None:
        """Let all environments begin with a step.

        Raises:
            ActionError: the actions are not an array of the action space's shape and kind.
        """
        write_actions(self._engine, actions)
        self._engine.send("step")

    def step_wait(self) -> Step:
        """Return what came of the step: observations, rewards, ends and infos.

        An environment whose episode is over has been reset: its info has ``terminal_observation``.
        """
        observations, infos = self._gather()
        memory = self._engine.memory
        for number, info in enumerate(infos):
            if "final_obs" in info:
                last, final = info.pop("final_obs"), info.pop("final_info")
                self.reset_infos[number] = info
                infos[number] = {**final, "terminal_observation": last}
            infos[number]["TimeLimit.truncated"] = bool(memory.truncated[number] and not memory.terminated[number])
        return observations, memory.rewards.astype(np.float32), memory.terminated | memory.truncated, infos

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Return the pictures of all environments."""
        return self.env_method("render")

    def has_attr(self, attr_name: str) -> bool:
        """Return whether all environments have an attribute."""
        return all(self._ask("has", None, attr_name))

    def get_attr(self, attr_name: str, indices: Indices = None) -> list[Any]:
        """Read an attribute of some environments."""
        return self._ask("get", indices, attr_name)

    def set_attr(self, attr_name: str, value: Any, indices: Indices = None) -> None:
        """Set an attribute of some environments to one value."""
        self._ask("set", indices, attr_name, [value] * self.num_envs)

    def env_method(self, method_name: str, *args: Any, indices: Indices = None, **kwargs: Any) -> list[Any]:
        """Call a method of some environments."""
        return self._ask("call", indices, method_name, args, kwargs)

    def env_is_wrapped(self, wrapper_class: type[gymnasium.Wrapper], indices: Indices = None) -> list[bool]:
        """Return whether some environments are wrapped by a class."""
        return self._ask("wrapped", indices, full_name(wrapper_class))

    def close(self) -> None:
        """Close the environments and end the workers; closing twice is allowed."""
        self._engine.close()

    def _ask(self, command: str, indices: Indices, *arguments: Any) -> list[Any]:
        """Return answers in the order of the indices, which may be negative; the engine answers in its own."""
        wanted = [range(self.num_envs)[index] for index in self._get_indices(indices)]
        self._engine.send(command, sorted(set(wanted)), *arguments)
        answers = dict(zip(sorted(set(wanted)), self._engine.receive(), strict=True))
        return [answers[number] for number in wanted]

    def _gather(self) -> tuple[Any, list[dict[str, Any]]]:
        """Wait for the environments; return what they observe, and an info of each."""
        arrays = gather(self._engine, self._note)
        single = not isinstance(self.observation_space, gymnasium.spaces.Dict)
        return arrays[""] if single else arrays, [nest(flat) for flat in self._flat]

    def _note(self, part: PartialAnswer) -> None:
        for number, (new, gone) in zip(part.numbers, part.changes, strict=True):
            flat = self._flat[number]
            flat.update(new)
            for path in gone:
                del flat[path]


def sb3_vec_env(
    n: int,
    env_id: str | Callable[[], gymnasium.Env] = "CHMARL/SceneGraph-v0",
    workers: int | None = None,
    **options: Any,
) -> HouseholdVecEnv:
    """Return ``n`` environments as one VecEnv of Stable-Baselines3.

    >>> envs = chmarl_pb.sb3_vec_env(2, "CHMARL/SceneGraphHumanoid-v0", workers=1, split="val-unseen")
    >>> envs.reset()["self"].shape[0]
    2
    >>> envs.close()

    Args:
        n: number of environments.
        env_id: id of the environments, or a function that returns one, for wrappers.
        workers: number of processes that step environments, this one among them; 0 or 1: this one alone; None: one
            for each core.
        **options: of each environment; see :class:`chmarl_pb.envs.options.Options`.

    Raises:
        OptionError: an argument has a value that it does not know.
        HomeError: a home cannot be used.
        WorkerError: a worker died.
    """
    check_counts(n, workers)
    return HouseholdVecEnv(start(make_function(env_id, options), n, workers, AutoresetMode.SAME_STEP), n)
