"""Messages and feedback that are noisy, missing, wrong or late."""

from collections import Counter
from typing import Any

import numpy as np
import pytest

import chmarl_pb
from chmarl_pb.errors import OptionError
from chmarl_pb.tasks.unreliable import NoisyBoard, UnreliableAdviser, _Unreliable

IDLE = {"humanoid": 9, "drone": 8}


def heard(feedback: Any, steps: int = 12, task: str = "val-unseen-000", templates: int = 1) -> list[str]:
    """Return what an idle humanoid is told."""
    env = chmarl_pb.parallel_env(feedback=feedback, split="val-unseen", templates=templates)
    env.reset(options={"task": task})
    told = [env.step(IDLE)[-1]["humanoid"]["feedback"] for _ in range(steps)]
    env.close()
    return told


def test_a_perfect_dial_says_what_the_style_says() -> None:
    for style in ("paper", "planner"):
        assert heard(UnreliableAdviser(style)) == heard(style)
    mended = heard("planner", templates=2)
    assert heard(UnreliableAdviser("planner"), templates=2) == mended != heard("planner")


def test_sentences_come_late_and_none_is_lost() -> None:
    usual = heard("planner")
    assert all(usual)
    assert heard(UnreliableAdviser("planner", delay=3)) == ["", "", "", *usual[:-3]]


def test_some_sentences_are_lost_and_the_others_stay() -> None:
    usual, left = heard("planner", 28), heard(UnreliableAdviser("planner", loss=0.5), 28)
    assert {said for said in left} > {""} and all(said in ("", whole) for said, whole in zip(left, usual, strict=True))
    assert left == heard(UnreliableAdviser("planner", loss=0.5), 28)
    assert left != heard(UnreliableAdviser("planner", loss=0.5), 28, "val-unseen-001")


def test_wrong_sentences_name_another_action() -> None:
    right, wrong = heard("planner"), heard(UnreliableAdviser("planner", wrong=1.0))
    assert all(wrong) and not set(right) & set(wrong)


def test_wrong_sentences_name_another_verb_where_actions_point() -> None:
    env = chmarl_pb.parallel_env(
        "scene_graph", feedback=UnreliableAdviser("planner", wrong=1.0), split="val-unseen", pointing=True
    )
    twin = chmarl_pb.parallel_env("scene_graph", feedback="planner", split="val-unseen", pointing=True)
    said = []
    for number in range(4):
        for one in (env, twin):
            one.reset(options={"task": f"val-unseen-{number:03d}"})
        plan = next(iter(twin.simulation.solve(twin.task).plans.values())).actions
        twin.reset(options={"task": f"val-unseen-{number:03d}"})
        for action in [*plan[:-1], *["stay"] * 3]:  # to where it is better to place
            wanted = {name: names.index("stay") for name, names in env.action_names.items()}
            wanted["humanoid"] = env.action_names["humanoid"].index(action)
            said.append([one.step(wanted)[-1]["humanoid"]["feedback"] for one in (env, twin)])
    for one in (env, twin):
        one.close()
    assert all(wrong != right for wrong, right in said if right) and sum(bool(right) for _, right in said) >= 12


def test_wrong_actions_are_equally_likely() -> None:
    class Always:
        def before(self, action: str, outcome: Any) -> None: ...

        def after(self, succeeded: bool) -> str:
            return "a"

    critic = _Unreliable(Always(), ("a", "b", "c", "d", "e"), 0.0, 1.0, np.random.default_rng(0))
    counts: Counter[str | None] = Counter()
    for _ in range(3000):
        critic.before("e", None)  # type: ignore[arg-type]
        counts[critic.after(False)] += 1
    assert counts.keys() == {"b", "c", "d"} and min(counts.values()) > 900


def test_a_share_of_the_bits_is_misread() -> None:
    env = chmarl_pb.parallel_env(messages=NoisyBoard(0.25), split="val-unseen")
    env.reset(seed=0, options={"task": "val-unseen-000"})
    wrong = [np.mean(env.step(IDLE)[0]["drone"]["messages"] != env.messages) for _ in range(28)]
    env.close()
    assert 0.15 < np.mean(wrong) < 0.35 and len(set(wrong)) > 2


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: NoisyBoard(1.5), "flips=1.5"),
        (lambda: UnreliableAdviser("oracle"), "style='oracle'"),
        (lambda: UnreliableAdviser(loss=-0.1), "loss=-0.1"),
        (lambda: UnreliableAdviser(wrong=2), "wrong=2"),
        (lambda: UnreliableAdviser(delay=-1), "delay=-1"),
        (lambda: UnreliableAdviser(delay=True), "delay=True"),
    ],
)
def test_impossible_dials_are_refused(make: Any, message: str) -> None:
    with pytest.raises(OptionError, match=message):
        make()


def test_results_and_copies_know_the_dials() -> None:
    env = chmarl_pb.parallel_env(messages=NoisyBoard(0.2), feedback=UnreliableAdviser("planner", delay=2))
    recorded = env.options.recorded()
    assert "NoisyBoard(flips=0.2)" in recorded["messages"]
    assert "UnreliableAdviser(style='planner', loss=0.0, wrong=0.0, delay=2)" in recorded["feedback"]
    env.reset(seed=0)
    assert env.options.adviser is not env.options.adviser
    env.close()
