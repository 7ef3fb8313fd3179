"""Where an arm can surely reach, as plain numbers: homes and tasks plan with the humanoid's."""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

#: Lowest and highest height, nearest and farthest distance, metres.
Band: TypeAlias = tuple[float, float, float, float]


@dataclass(frozen=True)
class Reach:
    """The guaranteed reach of a gripper, relative to its robot's base.

    Attributes:
        distance: smallest and largest horizontal distance of the target from the base's centre, in metres.
        height: smallest and largest height of the target above the floor, in metres.
        bearing: largest angle between the base's heading and the direction to the target, in radians.
        best: distance that the arm likes most, in metres.
        bands: heights with distances of their own, lowest first; none: all heights have those of ``distance``.
    """

    distance: tuple[float, float]
    height: tuple[float, float]
    bearing: float
    best: float = 0.62
    bands: tuple[Band, ...] = ()

    def span(self, height: float) -> tuple[float, float] | None:
        """Return the smallest and the largest distance of targets at a height, in metres; None: it is out of reach."""
        if not self.height[0] <= height <= self.height[1]:
            return None
        if not self.bands:
            return self.distance
        return next(((near, far) for low, high, near, far in self.bands if low <= height <= high), None)

    def contains(self, distance: ArrayLike, height: ArrayLike, bearing: ArrayLike) -> NDArray[np.bool_]:
        """Tell which targets the arm surely reaches; the arguments broadcast.

        Args:
            distance: horizontal distances from the base's centre, in metres.
            height: heights above the floor, in metres.
            bearing: angles from the base's heading to the target, in radians, in any turn.
        """
        distance, height = np.asarray(distance, dtype=float), np.asarray(height, dtype=float)
        turn = np.abs(np.mod(np.asarray(bearing, dtype=float) + np.pi, 2 * np.pi) - np.pi)
        near, far = self.distance
        low, high = self.height
        return (near <= distance) & (distance <= far) & (low <= height) & (height <= high) & (turn <= self.bearing)


#: The humanoid's reach; ``tests/robots/test_arm.py`` holds the arm to it.
REACH = Reach(distance=(0.40, 0.92), height=(0.25, 1.50), bearing=float(np.radians(20)))
