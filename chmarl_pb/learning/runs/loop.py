"""Training one network for each agent of an environment, from the first rollout or from the last checkpoint on."""

from collections.abc import Callable
from contextlib import closing
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from torch import nn

from chmarl_pb.errors import WorkerError
from chmarl_pb.fingerprint import fingerprint
from chmarl_pb.learning.algorithms.dagger import DAggerConfig
from chmarl_pb.learning.algorithms.learner import Learner
from chmarl_pb.learning.algorithms.registry import Algorithm, check_first_weights, find_algorithm
from chmarl_pb.learning.benchmark_env import setting_of
from chmarl_pb.learning.config import RunConfig
from chmarl_pb.learning.rollouts.collect import Collector
from chmarl_pb.learning.rollouts.workers import rollouts_of
from chmarl_pb.learning.runs.device import find_device
from chmarl_pb.learning.runs.interrupts import Signals, StopRequested
from chmarl_pb.learning.runs.lock import run_lock
from chmarl_pb.learning.runs.logger import Logger
from chmarl_pb.learning.runs.run import BEST, LAST, Run
from chmarl_pb.learning.runs.validation import Validate, by_return
from chmarl_pb.learning.storage.checkpoint import check_kept, load, plain, reading
from chmarl_pb.learning.threads import threads as torch_threads
from chmarl_pb.policies.expert import Expert
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.registry import make_expert, make_policy
from chmarl_pb.processes import ProcessDiedError


def expert_name(expert: Callable[[Any], Expert | Policy]) -> str:
    """Return the name of what makes an expert: of a built-in policy its own, of others ``module:name``.

    A hash follows where the name does not tell all, as of a partial with its arguments, or of a function in another.
    """
    make = expert.func if isinstance(expert, partial) else expert
    if isinstance(expert, partial) and make in (make_policy, make_expert):
        return str((*expert.args, expert.keywords.get("name"))[0])
    named = make if hasattr(make, "__qualname__") else type(make)
    name = f"{named.__module__}:{named.__qualname__}"
    told = named is expert and "<locals>" not in name
    held = None if told else fingerprint(expert, code=False)
    return f"{name} {held[:16]}" if held else name


def _check_arguments(
    algorithm: str, row: Algorithm, *, env_fn: Any, config: Any, expert: Any, setting: Any, validate: Any, writes: bool
) -> None:
    """Refuse arguments of ``train`` of another kind, before anything is made.

    Raises:
        ValueError: one is, or there is nobody to imitate.
    """
    if not callable(env_fn):
        raise ValueError(f"env_fn={env_fn!r}: give what makes an environment, e.g. chmarl_pb.parallel_env")
    if validate is not None and not callable(validate):
        raise ValueError(f"validate={validate!r}: give what is called with a collector and the networks")
    if not isinstance(config, row.config):
        raise ValueError(f"config={config!r}: {algorithm} takes settings of the class {row.config.__name__}")
    if expert is not None and not callable(expert):
        raise ValueError(f"expert={expert!r}: give what makes an expert in an environment")
    if row.imitates and expert is None:
        raise ValueError(f"{algorithm} needs an expert to imitate, e.g. expert=partial(make_policy, 'belief')")
    if setting is not None and not isinstance(setting, dict):
        raise ValueError(f"setting={setting!r}: give a dict")
    plain(setting, "setting")
    if writes:
        plain(asdict(config), "config")


@dataclass(frozen=True)
class Result:
    """A finished run.

    Attributes:
        learner: with the last weights.
        agents: agent -> its network, with the last weights.
        best_score: of the best validation; its weights are in ``best.pt`` of the run's folder.
    """

    learner: Learner
    agents: nn.ModuleDict
    best_score: float


def train(
    env_fn: Callable[[], Any],
    algorithm: str,
    config: RunConfig | None = None,
    folder: Path | str | None = None,
    validate: Validate | None = None,
    setting: dict[str, Any] | None = None,
    quiet: bool = True,
    expert: Callable[[Any], Expert | Policy] | None = None,
    threads: int = 1,
    device: str = "cpu",
) -> Result:
    """Train one network for each agent of a PettingZoo ParallelEnv.

    >>> from functools import partial
    >>> from chmarl_pb.learning import Config
    >>> config = Config(episodes=4, horizon=3, envs=2, batch_size=2, learning_starts=2, features=8, hidden=8)
    >>> result = train(partial(chmarl_pb.parallel_env, split="val-unseen", max_steps=3), "qmix", config)
    >>> sorted(result.agents)
    ['drone', 'humanoid']

    Agents may differ in their actions, Discrete or MultiDiscrete, and in their observations: a Box, Discrete,
    MultiDiscrete or MultiBinary, or a Dict of these. Each component of an action has a head of its own, see
    :mod:`chmarl_pb.learning.components`. Mixers see
    ``env.state()``, or all observations if there is none, and learn from the mean of the agents' rewards; IQL learns
    from each agent's own. Actions are masked only if infos have an ``action_mask``. With a folder, the same call goes
    on with an interrupted run from its last checkpoint, and ends with the same numbers. The first SIGINT (Ctrl-C),
    SIGTERM or SIGHUP saves at once and ends the run, a second one ends it without that; a killed run loses a minute at
    most.

    Args:
        env_fn: makes an environment.
        algorithm: a name in :data:`chmarl_pb.learning.algorithms.registry.ALGORITHMS`.
        config: everything else that fixes the run; of the class that the algorithm has there.
        folder: for checkpoints and metrics; None: nothing is written.
        validate: chooses the best weights: called with what plays episodes and the networks by agent, it returns a dict
            of numbers, of which that named ``score`` is the greater the better; the mean return of greedy episodes if
            None.
        setting: what policies made from the checkpoints have to know, see :mod:`chmarl_pb.learning.policies.learned`;
            None: where an environment of the benchmark was trained in, with which alone a run goes on.
        quiet: whether no progress is shown.
        expert: makes what is imitated in an environment: a policy, or an expert that observes the actions taken in its
            place, see :class:`chmarl_pb.policies.expert.Expert`; algorithms that imitate nobody ask it nothing.
        threads: of torch, while this runs; networks as small as these are fastest with one.
        device: of torch, that the networks learn and act on; an interrupted run may go on on another.

    Raises:
        Interrupted: a signal asked the run to end.
        WorkerError: another process has died.
        ValueError: an argument or the environment is of another kind, there is nobody to imitate, or no such device.
        CheckpointError: the folder's checkpoint is damaged, of other settings, or gone while its best weights are
            there, another process trains there, or the run is over and its best weights are gone.
    """
    row, folder = find_algorithm(algorithm), None if folder is None else Path(folder)
    config = row.config() if config is None else config
    _check_arguments(
        algorithm, row, env_fn=env_fn, config=config, expert=expert, setting=setting, validate=validate,
        writes=folder is not None,
    )  # fmt: skip
    if isinstance(config, DAggerConfig) and expert is not None:
        config = replace(config, expert=expert_name(expert))
    imitated = expert if row.imitates else None
    where, signals = find_device(device), Signals()
    collector_of = partial(Collector, env_fn, expert=imitated, horizon=config.horizon)
    last = None if folder is None else folder / LAST
    with (
        torch_threads(threads), run_lock(folder, LAST, BEST),
        closing(collector_of(config.envs, check=signals.check)) as collector,
        rollouts_of(collector, collector_of, config.workers, threads, signals.check, config.overlap) as play,
    ):  # fmt: skip
        resumed = last is not None and last.exists()
        setting = setting_of(collector.envs[0]) if setting is None else setting
        if not resumed:
            check_first_weights(config, setting)
        run = Run(collector, play, algorithm, config, folder, validate or by_return(), setting, where, resumed)
        if last is not None and resumed:
            with reading(last):
                run.restore(load(last, "run"), last)
        with closing(Logger(folder, config.episodes, run.rows, quiet)) as logger, signals:
            try:
                while not run.is_over:
                    run.advance(logger)
                    signals.check()
            except StopRequested:
                run.save()
                raise signals.interrupted(f"{run.episodes} episodes", last) from None
            except ProcessDiedError as error:
                run.save()
                kept = f"the same command goes on from {last}; fewer workers need another folder" if last else ""
                unguarded = "" if run.episodes else ", or a script that calls train without if __name__ == '__main__':"
                raise WorkerError(
                    f"a process died after {run.episodes} episodes (out of memory{unguarded}?); "
                    f"{kept or 'nothing is kept'}"
                ) from error
        if folder is not None:
            check_kept(folder / BEST)
        return Result(run.learner, run.learner.agents, run.best_score)
