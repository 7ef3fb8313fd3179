"""Cut off the last bits of what a robot is commanded, which libraries round differently on different processors.

Linear algebra and trigonometry take other instructions on other processors, and differ by some 1e-16 there. Commands
that are rounded to micrometres and microradians are the same bits on all of them, and so are the motions they lead to.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

_DECIMALS = 6


def rounded(values: ArrayLike, lower: ArrayLike = -np.inf, upper: ArrayLike = np.inf) -> NDArray[np.float64]:
    """Return metres or radians, rounded to millionths and kept within limits."""
    exact: NDArray[np.float64] = np.clip(np.round(np.asarray(values, dtype=float), _DECIMALS), lower, upper)
    return exact + 0.0  # -0.0 becomes 0.0
