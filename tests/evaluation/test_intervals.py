"""Intervals: tasks are drawn anew, and homes where they are a sample of generated ones."""

import random
from statistics import mean

import numpy as np
import pytest

from chmarl_pb.evaluation.intervals import are_drawn, interval

Homes = dict[str, list[float]]


def sample(homes: int, tasks: int, spread: float, seed: int = 0) -> Homes:
    """Return scores of tasks whose homes differ by a spread; every other home has fewer of them."""
    rng = np.random.default_rng(seed)
    return {
        f"generated-{number}": list(rng.normal(0.5 + spread * rng.normal(), 0.1, tasks - number % 2 * tasks // 2))
        for number in range(homes)
    }


def resampled(homes: Homes, count: int = 4000) -> tuple[float, float]:
    """Draw homes, then tasks in them, one by one: the definition, without arrays."""
    rng, names, means = random.Random(1), list(homes), []
    for _ in range(count):
        values: list[float] = []
        for name in rng.choices(names, k=len(names)):
            values += rng.choices(homes[name], k=len(homes[name]))
        means.append(mean(values))
    means.sort()
    return means[round(0.025 * count)], means[round(0.975 * count)]


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_generated_homes_are_drawn_anew_and_then_their_tasks(spread: float) -> None:
    homes = sample(12, 8, spread)
    low, high = interval(homes)
    assert (low, high) == pytest.approx(resampled(homes), abs=0.1 * (high - low))
    assert (low, high) == interval(dict(reversed(homes.items()))), "the order of homes matters"


def test_the_spread_of_homes_widens_the_interval_as_theory_says() -> None:
    homes = {f"generated-{number}": [value] * 20 for number, value in enumerate(np.linspace(0.2, 0.8, 60))}
    low, high = interval(homes)
    error = np.std([values[0] for values in homes.values()]) / np.sqrt(len(homes))
    assert (low, high) == pytest.approx((0.5 - 1.96 * error, 0.5 + 1.96 * error), abs=0.01)


def test_in_homes_that_are_always_the_same_tasks_alone_are_drawn() -> None:
    homes = {f"home_{number}": [0.1 * number] * 5 for number in range(1, 6)}
    assert interval(homes) == pytest.approx((0.3, 0.3))
    mixed = {"generated-1" if name == "home_1" else name: values for name, values in homes.items()}
    assert interval(mixed) == pytest.approx((0.3, 0.3))


@pytest.mark.parametrize(
    ("homes", "drawn"),
    [
        (["generated-1", "generated-2"], True),
        (["generated-1"], False),
        (["home_1", "home_2"], False),
        (["generated-1", "home_2"], False),
    ],
)
def test_which_homes_are_a_sample(homes: list[str], drawn: bool) -> None:
    assert are_drawn(homes) == drawn
