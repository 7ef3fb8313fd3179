"""Where driven things are at every simulation step: pure geometry and time, no physics.

Every straight move starts and stops gently: its speed rises along a smooth step, holds, and falls the same way.
"""

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chmarl_pb.homes.solids import Points
from chmarl_pb.robots.rounding import rounded
from chmarl_pb.world import TIME_STEP

_NO_MOVE = 1e-4  # metres, radians or seconds at full speed that are not worth a step
_ALIGNED = 0.12  # radians: a base this near to its way need not turn first
_JOINT_RAMP = 0.25  # seconds in which joints come to full speed
# Mean accelerations on the way to the highest speed.
_DRIVING, _TURNING, _FLYING = 1.5, 4.0, 2.0  # m/s^2, rad/s^2, m/s^2


def drive(corners: Points, start: float, end: float, speed: float, turn_speed: float) -> Iterator[NDArray[np.float64]]:
    """Yield the legs of a base's way: turn to each straight piece, drive it, turn. It stands still between two legs.

    Args:
        corners: (m, 2) of the way, metres; the first is where the base stands.
        start: yaw that the base has, radians.
        end: yaw that it shall have at the last corner, radians.
        speed: highest, m/s.
        turn_speed: highest, rad/s.

    Yields:
        x, y (metres) and yaw (radians) at every step, shape (n, 3).
    """
    (x, y), yaw = corners[0].tolist(), start
    for goal_x, goal_y in corners[1:].tolist():
        ahead = float(rounded(np.arctan2(goal_y - y, goal_x - x)))
        if abs(wrap(ahead - yaw)) > _ALIGNED:
            yield _leg((x, y, angle) for angle in _turn(yaw, ahead, turn_speed))
            yaw = ahead
        yield _leg((*point, yaw) for point in _line((x, y), (goal_x, goal_y), (speed, _DRIVING)))
        x, y = goal_x, goal_y
    yield _leg((x, y, angle) for angle in _turn(yaw, end, turn_speed))


def fly(start: ArrayLike, end: ArrayLike, speed: float) -> Iterator[tuple[float, float]]:
    """Yield x and y (metres) of a straight flight at every step; ``speed`` is the highest, m/s."""
    return _line(start, end, (speed, _FLYING))


def move_joints(
    start: ArrayLike, end: ArrayLike, speeds: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], NDArray[np.float64], float]]:
    """Yield positions, velocities (per second) and the share done at every step of a move of several joints.

    Args:
        start: their positions, radians or metres.
        end: where they shall be.
        speeds: their highest speeds; the joint that needs longest sets the pace of all.
    """
    start = np.asarray(start, dtype=float)
    change = np.asarray(end, dtype=float) - start
    before = 0.0
    for share in profile(float(np.abs(change / speeds).max()), 1.0, 1 / _JOINT_RAMP).tolist():
        yield start + share * change, (share - before) / TIME_STEP * change, share
        before = share


def profile(distance: float, speed: float, acceleration: float) -> NDArray[np.float64]:
    """Return the share of a distance done after every step, the last is 1; empty for no distance.

    Args:
        distance: length of the move.
        speed: highest speed.
        acceleration: mean acceleration up to that speed, and down again.
    """
    if distance < _NO_MOVE:
        return np.zeros(0)
    peak = min(speed, float(np.sqrt(distance * acceleration)))
    ramp, total = peak / acceleration, distance / peak + peak / acceleration
    count = max(1, int(np.ceil(total / TIME_STEP)))
    middles = (np.arange(count) + 0.5) * total / count
    rise = np.minimum(1.0, np.minimum(middles, total - middles) / ramp)
    done = np.cumsum(rise * rise * (3 - 2 * rise))
    share: NDArray[np.float64] = done / done[-1]
    return share


def wrap(angle: float) -> float:
    """Return the same angle in radians between -pi and pi."""
    return float((angle + np.pi) % (2 * np.pi) - np.pi)


def _leg(places: Iterable[tuple[float, float, float]]) -> NDArray[np.float64]:
    return np.array(list(places), dtype=float).reshape(-1, 3)


def _turn(start: float, goal: float, speed: float) -> Iterator[float]:
    change = wrap(goal - start)
    return (start + share * change for share in profile(abs(change), speed, _TURNING).tolist())


def _line(start: ArrayLike, end: ArrayLike, limits: tuple[float, float]) -> Iterator[tuple[float, float]]:
    (x, y), (goal_x, goal_y) = np.asarray(start, dtype=float).tolist(), np.asarray(end, dtype=float).tolist()
    for share in profile(float(np.hypot(goal_x - x, goal_y - y)), *limits).tolist():
        yield x + share * (goal_x - x), y + share * (goal_y - y)
