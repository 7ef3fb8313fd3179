"""What each algorithm can represent of a table of joint values, computed without any learning.

With all joint actions equally often, a learner that minimises the squared error ends in a table of its class that no
small change brings nearer to the true one. For IQL and VDN that is one table; for QMIX there are bounds, which it
reaches in the games of :mod:`training.games`. Tables have agent 1's actions as rows and agent 2's as columns.
"""

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


def supermodular_fit(table: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the nearest table that rises with both agents' values, and the faster the higher the other's value is.

    This bounds QMIX: its mixing network is a sum of convex functions (ELU) of weighted sums, all weights
    at least 0, so the gain from raising both values is no less than the sum of the gains from raising each alone. An
    AND of two agents is such a table, an OR is not. Two by two tables of this kind are all within reach of QMIX;
    of larger ones perhaps not all. Different orders of the agents' values are different local optima.

    Args:
        table: the true one.
        order: a table whose row and column sums have the order of the agents' values.
    """
    rows, columns = np.argsort(order.sum(axis=1)), np.argsort(order.sum(axis=0))
    wanted = table[np.ix_(rows, columns)].ravel()
    found = minimize(
        lambda x: ((x - wanted) ** 2).sum(), np.sort(wanted), jac=lambda x: 2 * (x - wanted), method="SLSQP",
        constraints=[LinearConstraint(_rises(table.shape), 0, np.inf)], options={"ftol": 1e-12, "maxiter": 500},
    )  # fmt: skip
    fit = np.empty(table.shape)
    fit[np.ix_(rows, columns)] = found.x.reshape(table.shape)
    return fit


def _rises(shape: tuple[int, ...]) -> np.ndarray:
    """Return what makes of a flat table its differences along rows and columns, and its mixed second differences."""
    units = np.eye(int(np.prod(shape))).reshape(-1, *shape)
    differences = np.diff(units, axis=1), np.diff(units, axis=2), np.diff(np.diff(units, axis=1), axis=2)
    return np.hstack([part.reshape(len(units), -1) for part in differences]).T
