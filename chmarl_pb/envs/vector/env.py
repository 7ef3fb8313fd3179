"""Many environments at once, as Gymnasium's VectorEnv: several processes step them in memory that all share."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any, overload

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv

from chmarl_pb.envs.options import plain_value
from chmarl_pb.envs.registration import id_of
from chmarl_pb.envs.tracks import MAX_STEPS
from chmarl_pb.envs.vector.asking import Asking
from chmarl_pb.envs.vector.asynchronous import HouseholdAsyncEnv
from chmarl_pb.envs.vector.batch import MakeEnv
from chmarl_pb.envs.vector.engine import AnyEngine, processes_of, start
from chmarl_pb.envs.vector.exchange import Seeds, Step, gather, seed_of_each, write_actions
from chmarl_pb.envs.vector.pool import Pool
from chmarl_pb.errors import OptionError
from chmarl_pb.limits import whole_number
from chmarl_pb.world import Uncopied


class HouseholdVectorEnv(Uncopied, Asking, VectorEnv):
    """Environments of one kind, stepped together; see :func:`vector_env`.

    Observations, rewards, ends and infos are those of Gymnasium's ``SyncVectorEnv``.

    >>> envs = chmarl_pb.vector_env(2, workers=1, split="val-unseen")
    >>> observations, infos = envs.reset(seed=0)
    >>> observations["humanoid_messages"].shape
    (2, 2, 4)
    >>> envs.close()
    """

    _instead = "make another by vector_env(...)"
    _spec: EnvSpec | None = None

    def __init__(self, engine: AnyEngine, count: int, autoreset: AutoresetMode, copy: bool = True):
        """Join the environments of an engine.

        Args:
            engine: where they live; closed with this.
            count: their number.
            autoreset: when one whose episode is over is reset.
            copy: whether each step returns arrays of its own; if not, the next step overwrites the observations.
        """
        self._describe(engine, count, count, autoreset)
        self._copy = copy

    @property
    def spec(self) -> EnvSpec | None:
        """What ``gymnasium.make_vec`` has made this from; None if it has not. Its time limit is the environments'."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        limit = self._engine.signature.max_episode_steps
        self._spec = spec and replace(spec, max_episode_steps=limit)

    def reset(self, *, seed: Seeds = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Reset all environments.

        Args:
            seed: of the first one, the next have the next numbers; or one for each.
            options: of each reset, as :meth:`HouseholdEnv.reset` has them; ``reset_mask``, an array of bool,
                names the environments to reset, the others go on.

        Raises:
            OptionError: the seeds or the mask do not fit the environments.
        """
        options = dict(options or {})
        mask = self._mask(options.pop("reset_mask")) if "reset_mask" in options else None
        self._engine.send("reset", seed_of_each(seed, self.num_envs), [options or None] * self.num_envs, mask)
        return self._observations(), self._table.infos()

    def step(self, actions: Any) -> Step:
        """Step all environments.

        Args:
            actions: one for each environment.

        Raises:
            ActionError: the actions are not an array of the action space's shape and kind.
        """
        self.step_async(actions)
        return self.step_wait()

    def step_async(self, actions: Any) -> None:
        """Let the workers begin to step all environments, as Gymnasium's ``AsyncVectorEnv`` does; see :meth:`step`.

        Raises:
            AlreadyPendingCallError: the last step has not been waited for.
        """
        if self._engine.pending:
            self._engine.send("step")  # which refuses it, before actions of the last step are overwritten
        write_actions(self._engine, actions)
        self._engine.send("step")

    def step_wait(self) -> Step:
        """Step the environments of this process, wait for the workers, and return what :meth:`step` does.

        Raises:
            NoAsyncCallError: there was no :meth:`step_async`.
        """
        observations, memory = self._observations(), self._engine.memory
        ends = memory.terminated.copy(), memory.truncated.copy()
        return observations, memory.rewards.copy(), *ends, self._table.infos()

    def _observations(self) -> Any:
        """Wait for all environments; note their infos, and return what they observe."""
        arrays = gather(self._engine, lambda part: self._table.update(part.changes, part.numbers), self._copy)
        return self._as_observed(arrays)

    def _mask(self, mask: Any) -> np.ndarray:
        if (
            not isinstance(mask, np.ndarray)
            or mask.shape != (self.num_envs,)
            or mask.dtype != np.bool_
            or not mask.any()
        ):
            raise OptionError(f"reset_mask={mask!r} is not an array of {self.num_envs} bool with one True or more")
        return mask


def make_function(env_id: str | MakeEnv, options: dict[str, Any]) -> MakeEnv:
    """Return a function that makes an environment; see :func:`vector_env`.

    Raises:
        OptionError: options are given for a function.
    """
    if not callable(env_id):
        return partial(gymnasium.make, env_id, disable_env_checker=True, **_limited(env_id, options))
    if options:
        raise OptionError(f"options {sorted(options)} are for ids; a function makes its environment by itself")
    return env_id


def _limited(env_id: str, options: dict[str, Any]) -> dict[str, Any]:
    """Return options with a ``max_steps`` beyond the time limit of an id as that limit, which would come first."""
    spec = gymnasium.registry.get(env_id.rpartition(":")[2])
    most, limit = (spec and spec.max_episode_steps) or MAX_STEPS, plain_value(options.get("max_steps"))
    if not isinstance(limit, int) or limit <= most:
        return options
    given = plain_value(options.get("max_episode_steps"))  # ``gymnasium.make_vec`` gives that of the id by itself
    limit = min(limit, given) if isinstance(given, int) and given != most else limit
    return {name: value for name, value in options.items() if name != "max_steps"} | {"max_episode_steps": limit}


def check_counts(n: int, workers: int | None) -> None:
    """Check the number of environments and of workers.

    Raises:
        OptionError: one of them cannot be.
    """
    for name, value, least in (("n", n, 1), ("workers", 0 if workers is None else workers, 0)):
        whole_number(name, value, least)


@overload
def vector_env(
    n: int,
    env_id: str | MakeEnv = ...,
    workers: int | None = ...,
    autoreset_mode: AutoresetMode | str = ...,
    copy: bool = ...,
    backend: str = ...,
    batch_size: None = ...,
    **options: Any,
) -> HouseholdVectorEnv: ...


@overload
def vector_env(
    n: int,
    env_id: str | MakeEnv = ...,
    workers: int | None = ...,
    autoreset_mode: AutoresetMode | str = ...,
    copy: bool = ...,
    backend: str = ...,
    *,
    batch_size: int,
    **options: Any,
) -> HouseholdAsyncEnv: ...


def vector_env(
    n: int,
    env_id: str | MakeEnv = "CHMARL/SceneGraph-v0",
    workers: int | None = None,
    autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
    copy: bool = True,
    backend: str = "processes",
    batch_size: int | None = None,
    **options: Any,
) -> HouseholdVectorEnv | HouseholdAsyncEnv:
    """Return ``n`` environments as one Gymnasium VectorEnv or, with ``batch_size``, as one that need not wait for all.

    Args:
        n: number of environments.
        env_id: id of the environments, or a function that returns one, for wrappers.
        workers: number of processes that step environments, this one among them; 0 or 1: this one alone; None: one
            for each core.
        autoreset_mode: when an environment whose episode is over is reset.
        copy: whether each step returns arrays of its own; if not, the next step overwrites the observations.
        backend: "processes" of this machine, or "ray": each worker is an actor, with a processor of its own, of the
            Ray cluster that this process has joined, else of that of ``RAY_ADDRESS`` or of this machine.
        batch_size: None: all environments step together. Else they do not wait for each other, and so many are answered
            at once: those that are ready first; see :class:`chmarl_pb.envs.vector.asynchronous.HouseholdAsyncEnv`.
        **options: of each environment; see :class:`chmarl_pb.envs.options.Options`.

    Raises:
        OptionError: an argument has a value that it does not know.
        HomeError: a home cannot be used.
        WorkerError: a worker died.
    """
    n, workers, batch_size = map(plain_value, (n, workers, batch_size))
    check_counts(n, workers)
    try:
        mode = AutoresetMode(autoreset_mode)
    except ValueError as error:
        known = ", ".join(repr(mode.value) for mode in AutoresetMode)
        raise OptionError(f"autoreset_mode={autoreset_mode!r} is not known; use one of: {known}") from error
    make = make_function(env_id, options)
    if batch_size is not None:
        _check_batch(batch_size, n, mode, copy, backend)
        return HouseholdAsyncEnv(Pool(make, n, processes_of(n, workers), mode), n, batch_size, mode)
    return HouseholdVectorEnv(_engine(backend, make, n, workers, mode), n, mode, copy)


def _check_batch(batch_size: int, n: int, mode: AutoresetMode, copy: bool, backend: str) -> None:
    whole_number("batch_size", batch_size, 1, n)
    for given, reason in (
        (mode is AutoresetMode.DISABLED, "autoreset_mode='Disabled': environments are reset by themselves"),
        (not copy, "copy=False: each batch is an array of its own"),
        (backend != "processes", f"backend={backend!r}: environments live in processes of this machine"),
    ):
        if given:
            raise OptionError(f"batch_size={batch_size} does not go with {reason}")


def _engine(backend: str, make: MakeEnv, n: int, workers: int | None, mode: AutoresetMode) -> AnyEngine:
    if backend == "ray":
        from chmarl_pb.envs.vector.ray_engine import RayEngine  # which not everybody has

        return RayEngine(make, n, workers, mode)
    if backend != "processes":
        raise OptionError(f"backend={backend!r} is not known; use 'processes' or 'ray'")
    return start(make, n, workers, mode)


def _of_ids(kind: str) -> Callable[..., HouseholdVectorEnv]:
    """Return what ``gymnasium.make_vec`` makes vectors of the ids of a kind by; see :func:`vector_env`."""

    def make(num_envs: int, **options: Any) -> HouseholdVectorEnv:
        if options.pop("batch_size", None) is not None:
            raise OptionError("batch_size=... makes no VectorEnv of Gymnasium's; use chmarl_pb.vector_env")
        made: HouseholdVectorEnv = vector_env(num_envs, id_of(kind, options), **options)
        return made

    return make


joint_vector_env, humanoid_vector_env = _of_ids("joint"), _of_ids("humanoid")
grounded_joint_vector_env, grounded_humanoid_vector_env = _of_ids("grounded_joint"), _of_ids("grounded_humanoid")
