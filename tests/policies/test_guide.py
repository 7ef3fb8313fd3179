"""A robot that flies tells one that drives in which direction X is from there, and that one follows."""

from collections.abc import Iterator

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.catalog import BENCHMARK, class_of
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.belief.follower import Follower
from chmarl_pb.policies.belief.guide import Guide
from chmarl_pb.policies.code import RoomCode

SILENCE = np.zeros((1, 16), np.int8)


@pytest.fixture(scope="module")
def env() -> Iterator[HouseholdEnv]:
    env = chmarl_pb.parallel_env(split="val-unseen", track="grounded")
    yield env
    env.close()


def test_directions_are_those_from_the_robot_that_drives(env: HouseholdEnv) -> None:
    guide, off = Guide(env.rooms, ("humanoid",), BENCHMARK), []
    env.reset(options={"task": "val-unseen-000"})
    for room in range(4):
        observations, *_, infos = env.step({"humanoid": (room, 0), "drone": (room, 0)})
        state = env.simulation.world.state
        for name in set(infos["drone"]["visible"]) & state.objects.poses.keys():
            right, forward, _ = np.subtract(state.objects.poses[name][0], state.robots["humanoid"].base[0])
            same = [other for other in infos["drone"]["visible"] if class_of(other) == class_of(name)]
            told = guide.bearing(observations["drone"], class_of(name))
            if told is not None and len(same) == 1 and np.hypot(right, forward) > 0.8:
                off.append(np.angle(np.exp(1j * (told - np.arctan2(forward, right)))))
    assert len(off) > 5 and np.abs(off).max() < np.pi / 7, "within a sector"


def test_what_is_right_below_is_to_be_seen_from_aside(env: HouseholdEnv) -> None:
    guide = Guide(env.rooms, ("humanoid",), BENCHMARK)
    classes, views = np.zeros(96, np.int16), np.zeros((96, 3), np.float32)
    classes[:3] = [BENCHMARK.class_ids[name] for name in ("humanoid", "mug", "kitchen")]
    in_room = np.zeros((192, 3), np.int16)
    in_room[:2] = [(node, 2, chmarl_pb.catalog.RELATION_IDS["in_room"]) for node in (0, 1)]
    seen: dict[str, np.ndarray] = {
        "node_class": classes,
        "node_state": np.zeros(96, np.int16),
        "edges": in_room,
        "node_view": views,
    }
    for away, told in ((0.3, 0.0), (0.05, np.pi / 2)):
        views[:2] = [(0.3, 0.7, 0.05), (0.3 + away, 0.7, 0.01)]
        assert guide.bearing(seen, "mug") == pytest.approx(told, abs=1e-5)


def test_it_turns_goes_on_steps_aside_and_gives_up() -> None:
    follower, taken = Follower(), []
    for away, stuck in ((1.0, False), (0.1, False), *[(0.1, True)] * 9):
        follower.begin()
        action = follower.towards(away, stuck)
        taken.append(action)
        follower.note(action or "goto_kitchen", True)
    aside = [turn for side in ("turn_left", "turn_right") for turn in (side, side, side, "move_forward")]
    assert taken == ["turn_left", "move_forward", *aside, None]
    assert follower.towards(0.1, True) == "turn_left", "in another room it does so again"


def test_a_sidestep_that_was_not_followed_is_over() -> None:
    follower = Follower()
    assert follower.towards(0.0, True) == "turn_left"
    follower.note("stay", False)
    follower.begin()
    assert follower.towards(0.0, False) == "move_forward"


def test_it_points_in_every_step_and_news_of_x_come_first(env: HouseholdEnv) -> None:
    observations, infos = env.reset(options={"task": "val-unseen-000"})
    angle: list[float | None] = [None]
    speaker = RoomCode(env.rooms, 16, bearing=lambda *_: 1.0, guiding=lambda _, name, row: None if row else angle[0])
    hearer, facts, said = RoomCode(env.rooms, 16), [("desk", (1, 0))], []
    hearer._seen = lambda *_: []  # type: ignore[method-assign]
    speaker._seen = lambda *_: facts  # type: ignore[method-assign]
    seen = {**observations["drone"], "messages": SILENCE}
    for step in range(8):
        if step == 1:
            facts.append(("mug", (0, 2)))
        angle[0] = 3.0 if step > 4 else None
        speaker.listen(seen, infos["drone"])
        said.append(speaker.propose())
        speaker.note(said[-1])
    assert said == [5, 3, 10, 5, 10, 3, 12, 12]
    heard = {**seen, "messages": np.eye(16, dtype=np.int8)[[3]]}
    assert not hearer.listen(heard, infos["drone"])["live"].any()
    found = hearer.listen({**seen, "messages": np.eye(16, dtype=np.int8)[[12]]}, infos["drone"])
    assert found["live"].sum() == 1 and found["live"][0, 2]
    assert not hearer.listen(seen, infos["drone"])["live"].any(), "nothing has been said just now"
