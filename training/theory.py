"""What each algorithm can represent of a table of joint values, computed without any learning.

With all joint actions equally often, a learner that minimises the squared error ends in a table of its class that no
small change brings nearer to the true one. Tables have agent 1's actions as rows and agent 2's as columns.
"""

import numpy as np
from scipy.optimize import LinearConstraint, minimize


def independent_fit(table: np.ndarray) -> np.ndarray:
    """Return what IQL's two agents learn of the rows and of the columns, (2, A): the mean over what the other does."""
    return np.array([table.mean(axis=1), table.mean(axis=0)])


def additive_fit(table: np.ndarray) -> np.ndarray:
    """Return the nearest table of the form a_i + b_j, which is all that VDN can hold (least squares in closed form)."""
    rows, columns = independent_fit(table)
    return rows[:, None] + columns[None, :] - table.mean()


def monotonic_fit(table: np.ndarray, order: np.ndarray) -> np.ndarray:
    """Return the nearest table that is monotonic in both agents' values, which is all that QMIX can hold.

    QMIX first settles in which order each agent's values are, and then in the nearest table of this order, which
    is unique (isotonic regression). Different orders are different local optima. In the non-monotonic game, the order
    with both agents' A last leaves a squared error of 320, that with A first 288: the better one holds the optimum,
    but the mean payoff of A is the worst, so learning from small weights falls into the other.

    Args:
        table: the true one.
        order: a table whose row and column sums have the order of the agents' values.
    """
    rows, columns = np.argsort(order.sum(axis=1)), np.argsort(order.sum(axis=0))
    fit = np.empty_like(table)
    fit[np.ix_(rows, columns)] = _isotonic(table[np.ix_(rows, columns)])
    return fit


def _isotonic(table: np.ndarray) -> np.ndarray:
    """Return the nearest table that grows (or stays) along both axes."""
    numbers = np.arange(table.size).reshape(table.shape)
    pairs = [*zip(numbers[:-1].ravel(), numbers[1:].ravel(), strict=True)]
    pairs += zip(numbers[:, :-1].ravel(), numbers[:, 1:].ravel(), strict=True)
    differences = np.zeros((len(pairs), table.size))
    for row, (low, high) in enumerate(pairs):
        differences[row, low], differences[row, high] = -1, 1
    wanted = table.ravel()
    found = minimize(
        lambda x: ((x - wanted) ** 2).sum(), np.sort(wanted), jac=lambda x: 2 * (x - wanted), method="SLSQP",
        constraints=[LinearConstraint(differences, 0, np.inf)], options={"ftol": 1e-12, "maxiter": 500},
    )  # fmt: skip
    return found.x.reshape(table.shape)
