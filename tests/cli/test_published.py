"""What `chmarl-pb evaluate` says is published of weights stands beside results of the same rules alone."""

from typing import Any

import pytest

from chmarl_pb.cli.evaluate import _published
from chmarl_pb.envs.options import Options
from chmarl_pb.evaluation.result import Report
from chmarl_pb.policies.sources import find_policy

SPLIT = "test-unseen"


def report_of(**changes: Any) -> Report:
    """Return a result by the rules of published weights, or by others."""
    options = Options("scene_graph", SPLIT).recorded()
    own = {"observation": options.pop("observation"), "split": options.pop("split")}
    other: dict[str, Any] = {name: changes.pop(name) for name in ("split", "env") if name in changes}
    return Report({**own, "options": {**options, **changes}, **other}, {}, ())


def test_results_by_the_rules_of_the_weights_are_told_what_is_published() -> None:
    assert "(success / PLW on test-unseen)" in _published(find_policy("ours-graphs"), report_of())


@pytest.mark.parametrize(
    "change",
    [
        {"max_steps": 56}, {"feedback": False}, {"messages": False}, {"split": "train"},
        {"env": {"name": "my:env", "sha256": "0"}},
    ],
)  # fmt: skip
def test_results_by_other_rules_are_not(change: dict[str, Any]) -> None:
    assert _published(find_policy("ours-graphs"), report_of(**change)) == ""


def test_nothing_is_published_of_policies_without_weights() -> None:
    assert _published(find_policy("random"), report_of()) == ""
