"""What each algorithm can represent of a table of joint values, computed without any learning.

With all joint actions equally often, a learner that minimises the squared error ends in a table of its class that no
small change brings nearer to the true one. For IQL and VDN that is one table; for QMIX there are bounds, which it
reaches in the games of :mod:`training.games`. Tables have agent 1's actions as rows and agent 2's as columns.
"""

from collections.abc import Callable

import numpy as np
from scipy.optimize import LinearConstraint, minimize


def independent_fit(table: np.ndarray) -> np.ndarray:
    """Return what IQL's two agents learn of the rows and of the columns, (2, A): the mean over what the other does."""
    return np.array([table.mean(axis=1), table.mean(axis=0)])


def additive_fit(table: np.ndarray) -> np.ndarray:
    """Return the nearest table of the form a_i + b_j, which is all that VDN can hold (least squares in closed form)."""
    rows, columns = independent_fit(table)
    fitted: np.ndarray = rows[:, None] + columns[None, :] - table.mean()
    return fitted


def monotonic_fit(table: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the nearest table that rises (or stays) with both agents' values (isotonic regression).

    It is a bound: no mixer with dQ_tot / dQ_i >= 0 comes nearer while the agents' values are in this order. Different
    orders are different local optima. In the non-monotonic game, the order with both agents' A last leaves a squared
    error of 320, that with A first 288: the better one holds the optimum, but the mean payoff of A is the worst, so
    learning from small weights falls into the other.

    Args:
        table: the true one.
        order: a table whose row and column sums have the order of the agents' values.
    """
    return _nearest(table, order, _rises)


def supermodular_fit(table: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the nearest table that rises with both agents' values, and the faster the higher the other's value is.

    This bounds QMIX more tightly: its mixing network is a sum of convex functions (ELU) of weighted sums, all weights
    at least 0, so the gain from raising both values is no less than the sum of the gains from raising each alone. An
    AND of two agents is such a table, an OR is not. Two by two tables of this kind are all within reach of QMIX;
    of larger ones perhaps not all.

    Args:
        table: the true one.
        order: a table whose row and column sums have the order of the agents' values.
    """
    return _nearest(table, order, lambda shape: np.vstack([_rises(shape), _rises_together(shape)]))


def _nearest(table: np.ndarray, order: np.ndarray, bounds: Callable[[tuple[int, ...]], np.ndarray]) -> np.ndarray:
    """Return the nearest table of which no bound is negative, once its rows and columns are put in order."""
    rows, columns = np.argsort(order.sum(axis=1)), np.argsort(order.sum(axis=0))
    wanted = table[np.ix_(rows, columns)].ravel()
    found = minimize(
        lambda x: ((x - wanted) ** 2).sum(), np.sort(wanted), jac=lambda x: 2 * (x - wanted), method="SLSQP",
        constraints=[LinearConstraint(bounds(table.shape), 0, np.inf)], options={"ftol": 1e-12, "maxiter": 500},
    )  # fmt: skip
    fit = np.empty(table.shape)
    fit[np.ix_(rows, columns)] = found.x.reshape(table.shape)
    return fit


def _rises(shape: tuple[int, ...]) -> np.ndarray:
    """Return what makes of a flat table all its differences from row to row and from column to column."""
    units = np.eye(int(np.prod(shape))).reshape(-1, *shape)
    return np.hstack([np.diff(units, axis=axis).reshape(len(units), -1) for axis in (1, 2)]).T


def _rises_together(shape: tuple[int, ...]) -> np.ndarray:
    """Return what makes of a flat table all its mixed second differences."""
    units = np.eye(int(np.prod(shape))).reshape(-1, *shape)
    return np.diff(np.diff(units, axis=1), axis=2).reshape(len(units), -1).T
