"""Play jobs (task, seed) with one policy, in this process or in several."""

import pickle
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache, partial

import numpy as np

from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.metrics import Played, played
from chmarl_pb.policies.policy import Factory
from chmarl_pb.policies.registry import BUILT_IN
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.processes import in_processes
from chmarl_pb.tasks.task import Task

Job = tuple[Task, int]


@dataclass(frozen=True)
class Setup:
    """What all episodes of an evaluation share.

    Attributes:
        policy: see :func:`chmarl_pb.policies.sources.find_policy`.
        options: of the environment.
    """

    policy: str | Factory
    options: Options


class Player:
    """One environment and one policy, for one episode after the other."""

    def __init__(self, setup: Setup):
        """Make both.

        Raises:
            OptionError: there is no such policy.
        """
        make = find_policy(setup.policy).make
        self.env = HouseholdEnv(**asdict(setup.options))
        self.policy = make(self.env)

    def play(self, job: Job) -> Played:
        """Play one job; its result does not depend on those before it."""
        task, seed = job
        return played(rollout(self.env, self.policy, episode_seed(task, seed), task), seed)

    def close(self) -> None:
        """Disconnect from physics."""
        self.env.close()


def episode_seed(task: Task, seed: int) -> int:
    """Return the seed of an episode: another one for every task, so that tasks are independent."""
    return int(np.random.SeedSequence([seed, task.seed]).generate_state(1)[0])


def play(setup: Setup, jobs: Sequence[Job], workers: int) -> Iterator[Played]:
    """Return the played episodes as they come, in no certain order; what is wrong with the policy is said at once.

    Args:
        setup: policy and options.
        jobs: what to play.
        workers: number of processes; 1 plays in this one.

    Raises:
        OptionError: there is no such policy, or it cannot be sent to other processes.
        WorkerError: one of them died.
    """
    workers = min(workers, len(jobs))
    if not jobs:
        return iter(())
    if workers == 1:
        return _play_here(Player(setup), jobs)
    try:
        pickle.dumps(setup)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise OptionError(
            f"the policy cannot be sent to other processes ({error}); use a function of a module, or workers=1"
        ) from error
    if setup.policy not in BUILT_IN:
        Player(setup).close()  # here, before processes are started for it
    return in_processes(partial(_play_one, setup), jobs, workers)


def _play_here(player: Player, jobs: Sequence[Job]) -> Iterator[Played]:
    try:
        yield from map(player.play, jobs)
    finally:
        player.close()


@lru_cache(maxsize=1)
def _player(setup: Setup) -> Player:
    return Player(setup)  # lives as long as its process


def _play_one(setup: Setup, job: Job) -> Played:
    return _player(setup).play(job)
