"""Bootstrap intervals of a mean over tasks: where it would lie with another draw of tasks, and of generated homes."""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from chmarl_pb.homes.generate.names import seed_of

RESAMPLES = 2000
CONFIDENCE = 0.95

Values = NDArray[np.float64]


def are_drawn(homes: Sequence[str]) -> bool:
    """Tell whether homes are a sample of generated ones, so that others might have been drawn in their place."""
    return len(homes) > 1 and all(seed_of(home) is not None for home in homes)


def interval(values: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Return the percentile interval of the mean of all values.

    Homes that were drawn are drawn anew, and then tasks within each; in homes that are always the same ones, tasks
    alone. The draw is seeded, so equal values give equal intervals.

    Args:
        values: home -> the values of its tasks, two or more in all.
    """
    homes = [list(values[home]) for home in sorted(values)]
    if are_drawn(list(values)):
        low, high = np.quantile(_means_of_drawn_homes(homes), [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
        return float(low), float(high)
    if min(map(len, homes)) < 2:  # a home with a single task cannot be drawn from: all tasks as of one home
        homes = [[value for home in homes for value in home]]
    result = stats.bootstrap(
        homes, _pooled_mean, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="percentile",
        random_state=np.random.default_rng(0),
    )  # fmt: skip
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def _pooled_mean(*samples: Values, axis: int = -1) -> Values:
    return np.asarray(np.concatenate(samples, axis=axis).mean(axis=axis))


def _means_of_drawn_homes(homes: Sequence[Sequence[float]]) -> Values:
    """Return the means (``RESAMPLES``,) of draws of as many homes, and of as many tasks in each as it has."""
    rng, values = np.random.default_rng(0), np.concatenate(homes)
    sizes = np.array([len(home) for home in homes])
    starts, places = np.cumsum(sizes) - sizes, np.arange(sizes.max())
    sums, counts = np.zeros(RESAMPLES), np.zeros(RESAMPLES)
    for drawn in rng.integers(len(homes), size=(len(homes), RESAMPLES)):
        size = sizes[drawn][:, None]
        tasks = starts[drawn][:, None] + (rng.random((RESAMPLES, len(places))) * size).astype(int)
        sums += np.where(places < size, values[tasks], 0.0).sum(axis=1)
        counts += sizes[drawn]
    means: Values = sums / counts
    return means
