"""Channels and advisers of one's own."""

import pickle
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

import chmarl_pb
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.messages import Board, Messages, Rooms
from chmarl_pb.tasks.outcome import Outcome


@dataclass(frozen=True)
class Late:
    """A board that is heard some steps later: what has been said is the last boards, the oldest first."""

    steps: int = 2

    def space(self, rooms: Rooms) -> spaces.Box:
        return Board().space(rooms)

    def begin(self, rooms: Rooms) -> Messages:
        return np.zeros((self.steps + 1, 2, len(rooms)), dtype=np.int8)

    def update(
        self, messages: Messages, outcome: Outcome, goal: Goal, rooms: Rooms, rng: np.random.Generator
    ) -> Messages:
        return np.concatenate([messages[1:], Board().update(messages[-1], outcome, goal, rooms, rng)[None]])

    def hear(self, messages: Messages, robot: str, rng: np.random.Generator) -> Messages:
        heard: Messages = messages[0]
        return heard.copy()


class Counting:
    """An adviser that counts the steps of an episode, and tells the drone."""

    def begin(self, simulation: Any, task: Any, goal: Any) -> None:
        self.count = 0

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        self.count += 1

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        return {"drone": f"You should have stayed, {self.count} of {step + 1}."}


TASK = chmarl_pb.load_tasks("val-unseen")[1]


def test_late_messages_come_late() -> None:
    prompt, late = (chmarl_pb.parallel_env(split="val-unseen", messages=given) for given in (True, Late(2)))
    assert late.state_space.shape[0] == prompt.state_space.shape[0] + 2 * 8
    played = [chmarl_pb.rollout(env, make_policy("planner", env), 0, TASK) for env in (prompt, late)]
    heard = [[seen["drone"]["messages"] for seen in episode.observations] for episode in played]
    assert len(heard[0]) == len(heard[1]) > 3
    np.testing.assert_array_equal(heard[1][2:], heard[0][:-2])
    assert late.state().shape == late.state_space.shape and not np.any(heard[1][:2])
    prompt.close()
    late.close()


def test_silence_is_heard_as_zeros_but_known() -> None:
    env = chmarl_pb.parallel_env(split="val-unseen", messages=False)
    episode = chmarl_pb.rollout(env, make_policy("planner", env), 0, TASK)
    assert env.messages.any() and not any(seen["drone"]["messages"].any() for seen in episode.observations)
    env.close()


def test_each_environment_has_its_own_adviser() -> None:
    given = Counting()
    first, second = (chmarl_pb.parallel_env(split="val-unseen", feedback=given) for _ in range(2))
    second.reset(seed=0)
    _, infos = first.reset(seed=0)
    assert infos["drone"]["feedback"] == ""
    for number in (1, 2):
        observations, *_, infos = first.step({"humanoid": 9, "drone": 8})
        assert infos["drone"]["feedback"] == f"You should have stayed, {number} of {number}."
    assert infos["humanoid"]["feedback"] == "" and observations["drone"]["feedback"].any()
    assert second.step({"humanoid": 9, "drone": 8})[-1]["drone"]["feedback"].endswith("1 of 1.")
    assert not hasattr(given, "count") and isinstance(pickle.loads(pickle.dumps(first)).options.feedback, Counting)
    first.close()
    second.close()


@pytest.mark.parametrize("option", [{"messages": "loud"}, {"messages": Late}, {"feedback": object()}])
def test_others_are_refused(option: dict[str, Any]) -> None:
    with pytest.raises(OptionError, match=f"{next(iter(option))}=.* is not known"):
        chmarl_pb.parallel_env(**option)


def test_objects_are_recorded_and_set_apart() -> None:
    report = chmarl_pb.evaluate("planner", "val-unseen", tasks=[TASK], workers=1, messages=Late(1), feedback=Counting())
    options = report.settings["options"]
    assert options["messages"].endswith("test_channels:Late(steps=1)")
    assert options["feedback"].endswith("test_channels:Counting")
    assert report.cooperation is None and "Late(steps=1)" in report.changed
