"""Where the humanoid's arm can surely reach, as plain numbers: homes and tasks plan with it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray


@dataclass(frozen=True)
class Reach:
    """The guaranteed reach of the humanoid's gripper, relative to its base.

    Attributes:
        distance: smallest and largest horizontal distance of the target from the base's centre, in metres.
        height: smallest and largest height of the target above the floor, in metres.
        bearing: largest angle between the base's heading and the direction to the target, in radians.
    """

    distance: tuple[float, float]
    height: tuple[float, float]
    bearing: float

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
