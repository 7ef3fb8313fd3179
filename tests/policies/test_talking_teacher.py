"""Policies that talk, as teachers: what they say next follows from what was really said."""

from collections.abc import Iterator

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.code import RoomCode, Talking
from chmarl_pb.policies.expert import PlainExpert, as_expert
from chmarl_pb.policies.registry import make_expert, make_policy

SILENCE = np.zeros((1, 16), np.int8)
X_IN_2, X_IN_0, Y_IN_0, DIRECTION = 3, 1, 5, 10  # of the code with four rooms; the angle 1.0


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", track="grounded")
    yield env
    env.close()


class Speaker:
    """One robot's side of the code, that sees X in room 2, its direction and Y in room 0, whatever is there."""

    def __init__(self, env: HouseholdEnv):
        observations, infos = env.reset(options={"task": "val-unseen-000"})
        self.code = RoomCode(env.rooms, 16, bearing=lambda _, name, room: 1.0 if room == 2 else None)
        self.code._seen = lambda *_: [("desk", (1, 0)), ("mug", (0, 2))]  # type: ignore[method-assign]
        self._seen, self._info = {**observations["drone"], "messages": SILENCE}, infos["drone"]

    def step(self, symbol: int | None = None) -> int:
        """Return what is to be said; what is said is that, or a symbol in its place."""
        self.heard = self.code.listen(self._seen, self._info)
        proposed = self.code.propose()
        assert self.code.propose() == proposed, "nothing counts as said before it is noted"
        self.code.note(proposed if symbol is None else symbol)
        return proposed


def test_what_is_followed_is_said_as_ever(env: HouseholdEnv) -> None:
    speaker = Speaker(env)
    assert [speaker.step() for _ in range(7)] == [X_IN_2, DIRECTION, Y_IN_0, X_IN_2, DIRECTION, Y_IN_0, 0]


def test_what_was_not_said_is_still_to_be_said(env: HouseholdEnv) -> None:
    speaker = Speaker(env)
    assert [speaker.step(0) for _ in range(3)] == [X_IN_2] * 3
    assert not speaker.heard["shared"].any(), "nobody has heard of it"
    assert [speaker.step(), speaker.step(0)] == [X_IN_2, DIRECTION]
    assert speaker.step() == DIRECTION, "what it has named last is not named again"
    assert [speaker.step(0), speaker.step()] == [Y_IN_0, Y_IN_0]


def test_what_was_said_in_its_place_counts(env: HouseholdEnv) -> None:
    speaker = Speaker(env)
    assert speaker.step(Y_IN_0) == X_IN_2
    said = [speaker.step() for _ in range(6)]
    assert said == [X_IN_2, DIRECTION, Y_IN_0, X_IN_2, DIRECTION, 0], "Y is told twice in all"


def test_others_know_what_was_said_and_not_what_was_meant(env: HouseholdEnv) -> None:
    speaker = Speaker(env)
    speaker.step(X_IN_0)
    speaker.step(0)
    assert speaker.heard["shared"][0].tolist() == [1, 0, 0, 0]
    assert speaker.heard["messages"][0].tolist() == [0, 0, 1, 0], "it knows better itself"


def test_a_wrong_direction_is_put_right(env: HouseholdEnv) -> None:
    speaker = Speaker(env)
    assert [speaker.step(), speaker.step(DIRECTION + 2), speaker.step()] == [X_IN_2, DIRECTION, DIRECTION]
    speaker.step()
    assert speaker.heard["bearings"][0, 2] == pytest.approx((DIRECTION - 8.5) * 2 * np.pi / 7)


@pytest.mark.parametrize("name", ["belief", "search"])
def test_a_teacher_that_is_followed_does_what_the_policy_does(env: HouseholdEnv, name: str) -> None:
    done = chmarl_pb.rollout(env, make_policy(name, env), 0, "val-unseen-003")
    teacher = as_expert(make_policy(name, env))
    assert isinstance(teacher, Talking)
    observations, infos = env.reset(seed=0, options={"task": "val-unseen-003"})
    teacher.reset(0)
    for actions, said in zip(done.actions, done.said, strict=True):
        proposed = teacher.propose(observations, infos)
        assert proposed == {robot: (actions[robot], said[robot]) for robot in actions}
        teacher.note({robot: np.array(pair) for robot, pair in proposed.items()})
        observations, *_, infos = env.step(proposed)


def test_robots_that_say_anything_are_led_to_the_goal(env: HouseholdEnv) -> None:
    """The drone is silent, or says what comes: the humanoid goes on by what it hears, and finds X by itself."""
    rng, solved = np.random.default_rng(0), 0
    teacher = as_expert(make_policy("belief", env))
    for number in range(4):
        observations, infos = env.reset(seed=0, options={"task": f"val-unseen-{number:03}"})
        teacher.reset(0)
        while env.agents:
            pairs = teacher.propose(observations, infos)
            done = {name: np.array([action, rng.integers(16)]) for name, (action, _) in pairs.items()}
            teacher.note(done)
            observations, *_, infos = env.step(done)
        solved += infos["humanoid"]["success"]
    assert solved >= 1


def test_policies_that_count_nothing_teach_too(env: HouseholdEnv) -> None:
    assert isinstance(as_expert(make_policy("reactive", env)), PlainExpert)
    told = as_expert(make_policy("belief-told", env))
    observations, infos = env.reset(seed=0)
    told.reset(0)
    proposed = told.propose(observations, infos)
    told.note(proposed)
    assert set(proposed) == {"humanoid", "drone"}


def test_a_teacher_of_those_who_see_pictures_points_as_one_who_sees_graphs(env: HouseholdEnv) -> None:
    pictures = chmarl_pb.parallel_env("visual", split="val-unseen", track="grounded", image_size=32)
    found: list[list[dict[str, tuple[int, int]]]] = []
    for seen in (env, pictures):
        observations, infos = seen.reset(seed=0, options={"task": "val-unseen-008"})
        teacher, proposed = make_expert("belief", seen), []
        teacher.reset(0)
        while seen.agents:
            proposed.append(teacher.propose(observations, infos))
            teacher.note(proposed[-1])
            observations, *_, infos = seen.step(proposed[-1])
        found.append(proposed)
    assert found[0] == found[1] and infos["humanoid"]["success"]
    pictures.close()
