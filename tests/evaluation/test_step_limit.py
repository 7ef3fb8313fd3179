"""The table in docs/benchmark.md of what the random policy solves within other step limits is what it solves."""

import re
from pathlib import Path

import pytest

import chmarl_pb
from chmarl_pb.cli.baselines import success_within

PAGE = Path(__file__).parents[2] / "docs" / "benchmark.md"


@pytest.mark.slow
def test_the_random_policy_solves_what_the_page_says() -> None:
    text = PAGE.read_text(encoding="utf-8")
    row = text.splitlines()[(place := text[: text.index("| random, test-unseen, success % |")].count("\n"))]
    limits = [int(number) for number in re.findall(r"\d+", text.splitlines()[place - 2])]
    command = re.search(r"`chmarl-pb evaluate --policy random --split test-unseen --seeds 12 --max-steps (\d+) ", text)
    assert command and int(command[1]) == max(limits)
    report = chmarl_pb.evaluate("random", "test-unseen", seeds=range(12), max_steps=max(limits))
    shares = [success_within(report.episodes, limit) for limit in limits]
    errors = [(share * (1 - share) / len(report.episodes)) ** 0.5 for share in shares]
    said = [f"{100 * share:.1f} ± {100 * error:.1f}" for share, error in zip(shares, errors, strict=True)]
    assert row == f"| random, test-unseen, success % | {' | '.join(said)} |"
