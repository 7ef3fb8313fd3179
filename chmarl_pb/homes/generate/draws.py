"""Random choices that are the same on every machine: whole numbers from the raw bits of PCG64."""

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

VERSION = 1
"""Of the rules by which homes are made: raised whenever a seed gives another home."""

T = TypeVar("T")


class Draws:
    """A stream of random choices."""

    def __init__(self, *key: int):
        """Start the stream of a key of whole numbers from 0 on, other in each version of the rules."""
        # Raw bits: NumPy promises them to stay, but not what ``Generator`` makes of them.
        self._bits = np.random.PCG64(np.random.SeedSequence((VERSION, *key)))

    def below(self, count: int) -> int:
        """Return one of 0, 1, ... ``count`` - 1."""
        return int(self._bits.random_raw()) * count >> 64

    def between(self, low: int, high: int, step: int = 1) -> int:
        """Return one of ``low``, ``low + step``, ... up to ``high``."""
        return low + step * self.below((high - low) // step + 1)

    def chance(self, per_cent: int) -> bool:
        """Return whether something of this likelihood happens."""
        return self.below(100) < per_cent

    def one_of(self, values: Sequence[T]) -> T:
        """Return one of some values."""
        return values[self.below(len(values))]

    def shuffled(self, values: Sequence[T]) -> list[T]:
        """Return the values in another order."""
        rest = list(values)
        return [rest.pop(self.below(len(rest))) for _ in values]

    def keys(self, count: int) -> NDArray[np.uint64]:
        """Return so many numbers to sort by."""
        return np.atleast_1d(np.asarray(self._bits.random_raw(count), dtype=np.uint64))
