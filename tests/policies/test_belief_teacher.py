"""The belief search as a teacher: what it advises follows from what the robots did, not from what it said."""

from collections.abc import Iterator

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.belief.policy import BeliefPolicy
from chmarl_pb.policies.belief.scouts import Scouts
from chmarl_pb.policies.belief.statistics import FLIGHTS, statistics

ROOMS = ("kitchen", "bedroom", "bathroom", "livingroom")
NOTHING = np.zeros((2, len(ROOMS)), dtype=bool)


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", feedback=False, max_steps=40)
    yield env
    env.close()


@pytest.fixture
def teacher(env: HouseholdEnv) -> BeliefPolicy:
    return BeliefPolicy(env.action_names, env.rooms, env.catalog)


def test_the_plan_goes_on_from_where_a_flyer_went() -> None:
    scouts = Scouts(["drone"], statistics(ROOMS), ["desk"])
    scouts.hear(NOTHING)
    scouts.decide()
    planned = scouts.actions["drone"]
    other = next(number for number, room in enumerate(ROOMS) if f"goto_{room}" != planned)
    scouts.note("drone", f"goto_{ROOMS[other]}")
    assert scouts.place("drone") == (other, (0, 0))
    scouts.hear(NOTHING)
    assert [bits == 1 << FLIGHTS.index((0, 0)) for bits in scouts.flown[0]] == [room == other for room in range(4)]
    scouts.decide()
    assert scouts.actions["drone"] == planned, "nobody has been there"
    scouts.note("drone", "move_right")
    assert scouts.place("drone") == (other, (1, 0))
    scouts.hear(NOTHING)
    scouts.decide()
    scouts.note("drone", "stay")
    assert scouts.place("drone") == (other, (1, 0))


def test_what_is_followed_is_what_the_policy_does(env: HouseholdEnv, teacher: BeliefPolicy) -> None:
    policy = BeliefPolicy(env.action_names, env.rooms, env.catalog)
    for task in ("val-unseen-003", "val-unseen-008"):
        done = chmarl_pb.rollout(env, policy, 0, task).actions
        observations, infos = env.reset(seed=0, options={"task": task})
        teacher.reset(0)
        for actions in done:
            assert teacher.propose(observations, infos) == actions
            teacher.note(actions)
            observations, *_, infos = env.step(actions)


def test_a_pick_that_was_not_done_is_proposed_again(env: HouseholdEnv, teacher: BeliefPolicy) -> None:
    names = env.action_names["humanoid"]
    pick, left = names.index("pick"), names.index("turn_left")
    passed, heard = 0, []
    observations, infos = env.reset(seed=0, options={"task": "val-unseen-008"})
    teacher.reset(0)
    while env.agents and passed < 2:
        actions = teacher.propose(observations, infos)
        heard.append(actions["humanoid"])
        if heard[-1] == pick:
            passed, actions = passed + 1, {**actions, "humanoid": left}
        teacher.note(actions)
        observations, *_, infos = env.step(actions)
    first = heard.index(pick)
    assert len(heard[first + 1 :]) <= 2, "X is in view still, or one move away"


def test_it_finds_out_of_what_a_bad_learner_got_into(env: HouseholdEnv, teacher: BeliefPolicy) -> None:
    solved, rng = 0, np.random.default_rng(0)
    for number in range(5):
        observations, infos = env.reset(seed=0, options={"task": f"val-unseen-{number:03}"})
        teacher.reset(0)
        for step in range(40):
            actions = teacher.propose(observations, infos)
            if step < 6:
                actions = {name: int(rng.integers(env.action_space(name).n)) for name in env.agents}
            teacher.note(actions)
            observations, *_, infos = env.step(actions)
            if not env.agents:
                break
        solved += infos["humanoid"]["success"]
    assert solved >= 4
