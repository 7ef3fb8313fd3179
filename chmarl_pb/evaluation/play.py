"""Play jobs (task, seed) with one policy, in this process or in several."""

import os
import pickle
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import chain
from typing import Any

import numpy as np

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import core_of_parallel, rollout
from chmarl_pb.envs.vector.sending import pickled
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.metrics import Played, played
from chmarl_pb.executors import Executor
from chmarl_pb.policies.policy import Factory, Policy, called
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.policies.seats import seated
from chmarl_pb.policies.sources import Source, find_policy, imported
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulations import MOST_SIMULATIONS
from chmarl_pb.tasks.tidy_task import AnyTask

Job = tuple[AnyTask, int]

#: Takes the keyword arguments of :func:`chmarl_pb.parallel_env` and returns that environment in wrappers of its own.
EnvFn = Callable[..., Any]


@dataclass(frozen=True)
class Setup:
    """What all episodes of an evaluation share.

    Attributes:
        policy: see :func:`chmarl_pb.policies.sources.find_policy`.
        options: of the environment.
        env_fn: makes the environment from the options as keyword arguments, or its name as ``module:callable``; None:
            the environment itself.
        sha256: of the policy that is to play, if that may change meanwhile; None: of what is there.
    """

    policy: str | os.PathLike[str] | Factory | Policy
    options: Options
    env_fn: str | EnvFn | None = None
    sha256: str | None = None

    @property
    def maker(self) -> EnvFn:
        """What makes the environment.

        Raises:
            OptionError: it cannot be imported.
        """
        return imported(self.env_fn, "environment") if isinstance(self.env_fn, str) else self.env_fn or HouseholdEnv

    @property
    def privileged(self) -> bool:
        """Whether the policy is given more than observations and action masks."""
        source = find_policy(self.policy)
        return source.privileged or (source.needs_graphs and not self.options.shows_graphs)

    def source(self) -> Source:
        """Return the policy.

        Raises:
            OptionError: there is none, or it is no more the one that is to play.
        """
        source = find_policy(self.policy)
        source.check(self.sha256)
        return source

    def make_policies(self, envs: Sequence[Any]) -> list[Policy]:
        """Return a policy for each environment.

        Raises:
            OptionError: it cannot be made, or is no more the one that is to play.
        """
        source = self.source()
        policies = [seated(source.make, env, self.privileged, source.centralized) for env in envs]
        source.check(self.sha256)  # each of them has been read by itself
        return policies

    def make_env(self) -> Any:
        """Return a new environment.

        Raises:
            OptionError: it is not a ParallelEnv made from this package's.
        """
        env = called(self.maker, "the options of parallel_env()", **vars(self.options))
        core_of_parallel(env)
        return env


class Player:
    """One environment and one policy, for one episode after the other."""

    def __init__(self, setup: Setup):
        """Make both.

        Raises:
            OptionError: there is no such policy, or the environment is not made from this package's.
        """
        self.env = setup.make_env()
        (self.policy,) = setup.make_policies([self.env])

    def play(self, job: Job) -> Played:
        """Play one job; its result does not depend on those before it."""
        task, seed = job
        start, own = seeds_to_play(self.env, task, seed)
        outcomes: list[Outcome] = []
        try:
            episode = rollout(self.env, self.policy, start, task, lambda core: outcomes.append(core.outcome), own)
        except SystemExit as error:  # it would end the command as if all were well
            raise OptionError(f"the policy, or a part of its environment, calls sys.exit({error.code!r})") from error
        return played(core_of_parallel(self.env), episode, seed, outcomes)

    def close(self) -> None:
        """Disconnect from physics."""
        self.env.close()


def seeds_to_play(env: Any, task: AnyTask, seed: int) -> tuple[int, int]:
    """Return the seeds of an episode, and of the policy in it; the environment is to be reset before it is played on.

    Args:
        env: a ParallelEnv made from this package's.
        task: to be played.
        seed: of the evaluation.
    """
    return episode_seed(task, seed), policy_seed(core_of_parallel(env).instruction_of(task), seed)


def episode_seed(task: AnyTask, seed: int) -> int:
    """Return the seed of an episode: another one for every task, so that tasks are independent."""
    return int(np.random.SeedSequence([seed, task.seed]).generate_state(1)[0])


def policy_seed(instruction: str, seed: int) -> int:
    """Return the seed that a policy gets: it tells no more of the task than what all its robots read."""
    words = np.frombuffer(instruction.encode(), dtype=np.uint8).tolist()
    return int(np.random.SeedSequence([seed, *words]).generate_state(1)[0])


def play(setup: Setup, jobs: Sequence[Job], executor: Executor) -> Iterator[Played]:
    """Return the played episodes as they come, in no certain order; what is wrong with the policy is said at once.

    Args:
        setup: policy and environment.
        jobs: what to play.
        executor: where they are played; one job, or one worker of this machine, plays here.

    Raises:
        OptionError: there is no such policy, or it cannot be sent to other processes.
        WorkerError: one of them died.
    """
    if not jobs:
        return iter(())
    if executor.alone or len(jobs) == 1:
        return _play_here(Player(setup), jobs)
    make = packed(setup)
    if setup.env_fn is not None or not isinstance(setup.policy, str) or setup.policy not in BUILT_IN:
        Player(setup).close()  # here, before processes are started for it
    lots = _lots(jobs, executor)
    return chain.from_iterable(executor.map(partial(_play_lot, make), lots))


def packed(setup: Setup) -> bytes:
    """Return what makes the player of a setup in another process.

    Raises:
        OptionError: it cannot be sent to other processes.
    """
    return pickled(partial(Player, setup), "the policy or the environment")


def _play_here(player: Player, jobs: Sequence[Job]) -> Iterator[Played]:
    try:
        yield from map(player.play, jobs)
    finally:
        player.close()


@lru_cache(maxsize=1)
def _player(make: bytes) -> Player:
    player: Player = pickle.loads(make).fn()  # lives as long as its process
    return player


def _play_lot(make: bytes, jobs: Sequence[Job]) -> list[Played]:
    return [_player(make).play(job) for job in jobs]


def _lots(jobs: Sequence[Job], executor: Executor) -> list[list[Job]]:
    """Return what one process plays at a time: few jobs, or those of a home if there are more homes than it keeps."""
    homes: dict[str, list[Job]] = defaultdict(list)
    for job in jobs:
        homes[job[0].home].append(job)
    share = max(1, len(jobs) // (4 * executor.workers))
    most = min(share, executor.worthwhile) if len(homes) <= MOST_SIMULATIONS else share
    return [same[first : first + most] for same in homes.values() for first in range(0, len(same), most)]
