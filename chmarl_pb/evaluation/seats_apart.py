"""Whether the robots' seats are apart: each is given once more what it got, alone, in another process.

In an evaluation they share a process, so policies could share what they observe by an attribute of a class or a cache
of a module. Who does so acts otherwise when the others neither observe nor act. What is shared by files is not found.
"""

import pickle
from collections.abc import Sequence
from contextlib import closing
from copy import deepcopy
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from chmarl_pb.evaluation.play import Job, Player, Setup, packed
from chmarl_pb.policies.policy import Actions, Infos, Observations, Policy
from chmarl_pb.policies.seats import Seats
from chmarl_pb.processes import in_processes

_EPISODES = 4


@dataclass(frozen=True)
class _Call:
    """What a seat was given and what it answered.

    Attributes:
        robot: whose seat.
        episode: number of the episode.
        step: in it, from 1 on; 0 for its reset.
        given: the observations and infos, or the seed.
        answer: the action as plain numbers, None for a reset.
    """

    robot: str
    episode: int
    step: int
    given: tuple[Any, ...]
    answer: Any


class _Noting:
    """A seat that notes what it is given and what it answers."""

    def __init__(self, robot: str, policy: Policy, calls: list[_Call]):
        self.robot, self.policy, self.calls = robot, policy, calls
        self._episode, self._step = -1, 0

    def reset(self, seed: int | None) -> None:
        self._episode, self._step = self._episode + 1, 0
        self.calls.append(_Call(self.robot, self._episode, 0, (seed,), None))
        self.policy.reset(seed)

    def act(self, observations: Observations, infos: Infos) -> Actions:
        given = deepcopy((observations, infos))
        answer = self.policy.act(observations, infos)
        self._step += 1
        self.calls.append(_Call(self.robot, self._episode, self._step, given, _plain(answer, self.robot)))
        return answer


def some_of(jobs: Sequence[Job]) -> Sequence[Job]:
    """Return the jobs of an evaluation that are played to look at the seats: a few, evenly spread."""
    return jobs[:: max(1, len(jobs) // _EPISODES)][:_EPISODES]


def what_is_shared(setup: Setup, jobs: Sequence[Job]) -> str:
    """Return how a seat acts otherwise alone than beside the others; empty if none does.

    Args:
        setup: environment, and a policy that has seats: neither privileged nor centralized.
        jobs: to play.

    Raises:
        OptionError: the policy cannot be sent to other processes.
        WorkerError: one of them died.
    """
    make = packed(setup)
    (calls,) = in_processes(partial(_noted, make), [jobs], 1)
    robots = list(dict.fromkeys(call.robot for call in calls))
    for seats in (robots, *([robot] for robot in robots)):
        own = [call for call in calls if call.robot in seats]
        (answers,) = in_processes(partial(_answers, make), [own], 1)
        if differing := next((pair for pair in zip(own, answers, strict=True) if pair[1] != pair[0].answer), None):
            return _words(*differing, jobs[differing[0].episode], alone=seats != robots)
    return ""


def _words(call: _Call, answer: Any, job: Job, alone: bool) -> str:
    """Return the sentence on a seat that acts otherwise, alone or when all is repeated."""
    where = f"task {job[0].id}, seed {job[1]}, step {call.step}: {call.answer} at first, then {answer}"
    if not alone:
        return (
            f"the policy of {call.robot!r} acts otherwise when all is repeated ({where}), so whether seats share "
            "anything cannot be told; let all that is drawn follow from reset(seed)"
        )
    return (
        f"the policy of {call.robot!r} acts otherwise where those of other robots, in its process, are given nothing "
        f"({where}), so they share memory or random numbers; keep these in the object, or let what makes the policy "
        "declare centralized = True"
    )


def _noted(make: bytes, jobs: Sequence[Job]) -> list[_Call]:
    """Play jobs, and return what each seat was given and answered."""
    calls = list[_Call]()
    with closing(_player(make)) as player:
        assert isinstance(player.policy, Seats)
        player.policy = Seats({name: _Noting(name, one, calls) for name, one in player.policy.policies.items()})
        for job in jobs:
            player.play(job)
    return calls


def _answers(make: bytes, calls: Sequence[_Call]) -> list[Any]:
    """Return what seats answer to what they are given again; the others are there, but given nothing."""
    with closing(_player(make)) as player:
        assert isinstance(player.policy, Seats)
        return [_answer(player.policy.policies[call.robot], call) for call in calls]


def _answer(policy: Policy, call: _Call) -> Any:
    try:
        return policy.reset(*call.given) if call.step == 0 else _plain(policy.act(*call.given), call.robot)
    except Exception as error:  # of the user's policy, which may miss what another one knows
        return repr(error)


def _player(make: bytes) -> Player:
    player: Player = pickle.loads(make).fn()
    return player


def _plain(answer: Any, robot: str) -> Any:
    """Return a seat's action as plain numbers."""
    return np.asarray(answer[robot]).tolist() if isinstance(answer, dict) and robot in answer else repr(answer)
