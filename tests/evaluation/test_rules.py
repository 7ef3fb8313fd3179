"""By which options a policy plays: those of its training, where none are given."""

import pytest

import chmarl_pb
from chmarl_pb.envs.tracks import OF_TRACK
from chmarl_pb.evaluation.rules import rules_with
from chmarl_pb.policies.sources import find_policy
from chmarl_pb.tasks.splits import load_tasks


def test_given_options_come_before_those_of_the_training() -> None:
    source = find_policy("ours-grounded")
    assert rules_with(source.rules, {}) == source.rules
    assert rules_with(source.rules, {"track": OF_TRACK, "lookalikes": False}) == {**source.rules, "lookalikes": False}


def test_another_track_leaves_nothing_of_the_rules_of_a_training() -> None:
    assert rules_with(find_policy("ours-grounded").rules, {"track": "paper"}) == {"track": "paper"}
    assert rules_with(find_policy("ours-graphs").rules, {"track": "grounded"}) == {"track": "grounded"}
    assert rules_with(find_policy("ppo-humanoid-graphs").rules, {"track": "grounded"})["goal"] is True


def test_a_policy_of_another_track_is_refused() -> None:
    with pytest.raises(chmarl_pb.ChmarlError, match="trained by other rules"):
        chmarl_pb.evaluate(
            "ours-grounded", "val-unseen", tasks=load_tasks("val-unseen")[:1], seeds=[0], workers=1, track="paper"
        )
