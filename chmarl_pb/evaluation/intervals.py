"""Bootstrap intervals of a mean over tasks: where it would lie with another draw of tasks, and of generated homes."""

from collections.abc import Callable, Mapping, Sequence

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

    Homes that were drawn are drawn anew, each with all its tasks; in homes that are always the same ones, tasks are.
    Drawing tasks within drawn homes, too, would count twice how much they differ, see Davison and Hinkley 1997, section
    3.8. The draw is seeded, so equal values give equal intervals.

    Args:
        values: home -> the values of its tasks, two or more in all.
    """
    homes = [list(values[home]) for home in sorted(values)]
    if are_drawn(list(values)):
        return _bootstrap([[sum(home) for home in homes], [len(home) for home in homes]], _ratio_of_sums, paired=True)
    if min(map(len, homes)) < 2:  # a home with a single task cannot be drawn from: all tasks as of one home
        homes = [[value for home in homes for value in home]]
    return _bootstrap(homes, _pooled_mean, paired=False)


def rate_interval(values: Mapping[str, Sequence[float]]) -> tuple[float, float]:
    """Return the interval of the mean of values from 0 to 1; see :func:`interval`.

    Where all are 0, or all 1, no draw of them tells how many might have been otherwise; that end is then the one of
    Clopper and Pearson 1934 for as many tasks, or drawn homes, with no exception among them.
    """
    every = [value for home in values.values() for value in home]
    if min(every) != max(every) or every[0] not in (0, 1):
        return interval(values)
    count = len(values) if are_drawn(list(values)) else len(every)
    otherwise = 1 - ((1 - CONFIDENCE) / 2) ** (1 / count)
    return (1 - otherwise, 1.0) if every[0] else (0.0, otherwise)


def _bootstrap(samples: Sequence[Sequence[float]], mean: Callable[..., Values], paired: bool) -> tuple[float, float]:
    result = stats.bootstrap(
        samples, mean, n_resamples=RESAMPLES, confidence_level=CONFIDENCE, method="percentile", paired=paired,
        vectorized=True, random_state=np.random.default_rng(0),
    )  # fmt: skip
    return float(result.confidence_interval.low), float(result.confidence_interval.high)


def _pooled_mean(*samples: Values, axis: int = -1) -> Values:
    return np.asarray(np.concatenate(samples, axis=axis).mean(axis=axis))


def _ratio_of_sums(sums: Values, counts: Values, axis: int = -1) -> Values:
    return np.asarray(sums.sum(axis=axis) / counts.sum(axis=axis))
