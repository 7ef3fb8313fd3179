"""Intervals: tasks are drawn anew, and homes where they are a sample of generated ones."""

import random
from statistics import mean

import numpy as np
import pytest
from scipy.stats import binomtest

from chmarl_pb.evaluation.intervals import are_drawn, interval, rate_interval

Homes = dict[str, list[float]]


def sample(homes: int, tasks: int, spread: float, seed: int = 0) -> Homes:
    """Return scores of tasks whose homes differ by a spread; every other home has fewer of them."""
    rng = np.random.default_rng(seed)
    return {
        f"generated-{number}": list(rng.normal(0.5 + spread * rng.normal(), 0.1, tasks - number % 2 * tasks // 2))
        for number in range(homes)
    }


def resampled(homes: Homes, count: int = 4000) -> tuple[float, float]:
    """Draw homes, one by one: the definition, without arrays."""
    rng, names, means = random.Random(1), list(homes), []
    for _ in range(count):
        means.append(mean(value for name in rng.choices(names, k=len(names)) for value in homes[name]))
    means.sort()
    return means[round(0.025 * count)], means[round(0.975 * count)]


@pytest.mark.parametrize("spread", [0.0, 0.3])
def test_generated_homes_are_drawn_anew(spread: float) -> None:
    homes = sample(12, 8, spread)
    low, high = interval(homes)
    assert (low, high) == pytest.approx(resampled(homes), abs=0.1 * (high - low))
    assert (low, high) == interval(dict(reversed(homes.items()))), "the order of homes matters"


@pytest.mark.parametrize("spread", [0.0, 0.1])
def test_nine_of_ten_intervals_and_more_but_not_all_cover_the_truth(spread: float) -> None:
    """Nominal are 95 per cent; drawing tasks within drawn homes, too, would give 99 and more."""
    rng, covered = np.random.default_rng(3), 0
    for _ in range(200):
        chances = np.clip(0.5 + spread * rng.normal(size=60), 0, 1)
        homes = {f"generated-{n}": list(rng.binomial(1, chance, 10).astype(float)) for n, chance in enumerate(chances)}
        low, high = interval(homes)
        covered += low <= 0.5 <= high
    assert 0.90 <= covered / 200 <= 0.98


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


@pytest.mark.parametrize("count", [2, 50])
@pytest.mark.parametrize("value", [0.0, 1.0])
def test_rates_of_none_and_of_all_have_the_ends_of_clopper_and_pearson(value: float, count: int) -> None:
    low, high = rate_interval({"home_1": [value] * count})
    exact = binomtest(int(value) * count, count).proportion_ci(method="exact")
    assert (low, high) == pytest.approx((exact.low, exact.high))
    drawn = {f"generated-{number}": [value] * 20 for number in range(count)}
    assert rate_interval(drawn) == (low, high), "it is the homes that are drawn"


def test_other_rates_have_the_interval_of_means() -> None:
    for values in ([0.0, 1.0, 1.0], [0.5, 0.5], [0.0, 0.25]):
        assert rate_interval({"home_1": values}) == interval({"home_1": values})
