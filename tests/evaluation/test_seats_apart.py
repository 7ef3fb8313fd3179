"""Seats share a process, and what policies share in it is found: alone they act otherwise."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.cli import main
from chmarl_pb.envs.options import Options
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation import protocol
from chmarl_pb.evaluation.play import Job, Setup
from chmarl_pb.evaluation.result import load_result
from chmarl_pb.evaluation.seats_apart import some_of, what_is_shared
from chmarl_pb.policies.policy import Actions, Infos, Observations

TASKS = chmarl_pb.load_tasks("val-unseen")[:2]
CACHE: dict[str, int] = {}


class Drawing:
    """Draws from a generator of its own, and goes on where its robot saw much."""

    def __init__(self, env: Any):
        self.counts = {robot: len(names) for robot, names in env.action_names.items()}

    def reset(self, seed: int | None) -> None:
        self.rng, self.seen = np.random.default_rng(seed), 0

    def act(self, observations: Observations, infos: Infos) -> Actions:
        ((robot, observation),) = observations.items()
        self.seen += self.heard() + sum(int(np.count_nonzero(part)) for part in observation.values())
        self.tell(self.seen)
        return {robot: int(self.rng.integers(self.counts[robot]) + self.seen) % self.counts[robot]}

    def heard(self) -> int:
        return 0

    def tell(self, seen: int) -> None:
        pass


class ByClass(Drawing):
    """Shares what its robot sees by an attribute of the class."""

    board: ClassVar[list[int]] = [0]

    def heard(self) -> int:
        return self.board[0]

    def tell(self, seen: int) -> None:
        self.board[0] = seen


class ByModule(Drawing):
    """Shares it by a cache of the module, and fails without."""

    def heard(self) -> int:
        return CACHE["drone"] if self.seen else 0

    def tell(self, seen: int) -> None:
        CACHE["humanoid" if "drone" not in CACHE and "humanoid" not in CACHE else "drone"] = seen


class Unseeded(Drawing):
    """Draws whatever the seed."""

    def reset(self, seed: int | None) -> None:
        super().reset(None)


class Central(Drawing):
    """Declares that one object drives all robots, so there are no seats."""

    centralized = True

    def act(self, observations: Observations, infos: Infos) -> Actions:
        return dict.fromkeys(observations, 0)


def shared(policy: Any, jobs: int = 2) -> str:
    setup = Setup(policy, Options(split="val-unseen", max_steps=4))
    return what_is_shared(setup, [(task, 0) for task in TASKS[:jobs]])


@pytest.mark.parametrize("policy", [Drawing, "belief", "search"])
def test_policies_that_keep_to_themselves_share_nothing(policy: Any) -> None:
    assert shared(policy) == ""


@pytest.mark.parametrize("policy", [ByClass, ByModule])
def test_what_seats_share_in_their_process_is_found(policy: Any) -> None:
    found = shared(policy, jobs=1)
    assert "acts otherwise where those of other robots, in its process, are given nothing (task val-unseen-000" in found
    assert "declare centralized = True" in found


def test_of_a_policy_that_draws_as_it_likes_nothing_can_be_told() -> None:
    assert "acts otherwise when all is repeated" in shared(Unseeded, jobs=1)


def test_few_jobs_are_played_for_it() -> None:
    jobs: list[Job] = [(task, 0) for task in chmarl_pb.load_tasks("val-unseen")]
    assert [task.id[-3:] for task, _ in some_of(jobs)] == ["000", "012", "024", "036"]
    assert some_of(jobs[:3]) == jobs[:3]


def test_results_say_whether_it_was_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    looked = list[Job]()

    def look(setup: Setup, jobs: Sequence[Job]) -> str:
        looked.extend(jobs)
        return ""

    monkeypatch.setattr(protocol, "what_is_shared", look)
    given: dict[str, Any] = {"tasks": TASKS, "seeds": [0], "workers": 1, "max_steps": 3, "out": tmp_path / "r.json"}
    without = chmarl_pb.evaluate(Drawing, "val-unseen", **given)
    assert "seats_apart" not in without.run and not looked
    checked = chmarl_pb.evaluate(Drawing, "val-unseen", reuse=True, check_seats=True, **given)
    assert checked.run["seats_apart"] == len(looked) == 2 and checked.sha256 == without.sha256
    assert load_result(tmp_path / "r.json").run == checked.run
    again = chmarl_pb.evaluate(Drawing, "val-unseen", reuse=True, check_seats=True, **given)
    assert again.run == checked.run and len(looked) == 2
    with pytest.raises(OptionError, match="is one policy for all robots, so there are no seats"):
        chmarl_pb.evaluate(Central, "val-unseen", check_seats=True, **given)
    with pytest.raises(OptionError, match="planner is told more than its robots observe"):
        chmarl_pb.evaluate("planner", "val-unseen", check_seats=True, **given)
    monkeypatch.setattr(protocol, "what_is_shared", lambda setup, jobs: "they share memory")
    with pytest.raises(OptionError, match="they share memory"):
        chmarl_pb.evaluate(Drawing, "val-unseen", check_seats=True, **given)


def test_the_command_looks_if_it_is_asked_to(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(protocol, "what_is_shared", lambda setup, jobs: "they share memory")
    command = ["evaluate", "--policy", "blind", "--task", "test-unseen-000", "--seeds", "1", "--workers", "1"]
    assert main(command) == 0
    assert main([*command, "--check-seats", "--out", str(tmp_path / "r.json")]) == 2
    assert "they share memory" in capsys.readouterr().err
    assert not list(tmp_path.glob("r.json*"))
