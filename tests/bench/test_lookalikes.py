"""The benchmark of lookalikes counts what policies take first of X's class."""

import pytest

pytest.importorskip("torch")

from benchmarks.lookalikes import first_taken, measured
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.tasks.splits import load_tasks


def test_who_reads_colours_takes_x_and_who_does_not_takes_any() -> None:
    env = HouseholdEnv(track="grounded", split="val-unseen")
    tasks = load_tasks("val-unseen")[:8]
    right = {
        name: [taken.is_x for task in tasks if (taken := first_taken(env, make_policy(name, env), task))]
        for name in ("belief", "colour-blind")
    }
    assert right["belief"] and all(right["belief"])
    assert right["colour-blind"] and not all(right["colour-blind"])
    taken = first_taken(env, make_policy("belief", env), tasks[0])
    assert taken is not None and 1 / 4 <= taken.chance <= 1 / 2  # one to three lookalikes
    assert first_taken(env, make_policy("random", env), tasks[0]) is None
    env.close()


def test_a_policy_is_measured_by_name() -> None:
    row = measured("belief", "scene_graph", "val-unseen", 50)
    assert row["tasks"] == 1 and row["taken"] == 1 and row["x"] == 1
