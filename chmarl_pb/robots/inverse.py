"""Inverse kinematics of any chain of joints: damped least squares from several starts, compiled.

The same arguments give the same bits in any process: no randomness, no simulation, no order of threads.
"""

from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled

Array: TypeAlias = NDArray[np.float64]

_NEAR = 2e-4  # metres between grasp point and target that count as reached
_STEPS = 30  # iterations from one start
_DAMPING = 1e-4  # added to the normal equations
_STALLED = 1e-4  # radians or metres: an iteration that moves no joint by more leads nowhere
_LARGEST = 0.4  # radians or metres of the joint that moves most in one iteration
_TURNING = 0.25  # metres that a gripper which points off by a radian counts as
_OFF = 0.1  # by which the direction of a gripper may be off, as a difference of unit vectors
_UPWARDS = 0.2  # of a unit vector: no gripper points higher
_FLOOR = 0.03  # metres above the floor that an arm keeps off it
_SKIN = 0.05  # metres of the base's column that an arm may come into at its mount


class Links(NamedTuple):
    """A chain of n joints.

    Attributes:
        turns: (n + 1, 3, 3) from each joint's moved frame to the next one's, base first, grasp point last.
        shifts: (n + 1, 3) the same, metres.
        axes: (n, 3) unit vectors in the joints' frames.
        slides: (n,) whether a joint slides rather than turns.
        lower: (n,) limits, radians or metres.
        upper: (n,) limits.
        pointing: (3,) where the gripper points in the frame of the grasp point; zeros: that is not known.
    """

    turns: Array
    shifts: Array
    axes: Array
    slides: NDArray[np.bool_]
    lower: Array
    upper: Array
    pointing: Array


class Column(NamedTuple):
    """The upright cylinder that an arm keeps off: its robot's base, up to where the arm is mounted.

    Attributes:
        radius: metres.
        height: metres.
    """

    radius: float
    height: float


@compiled
def place(links, joints, axes, points, pointing):  # type: ignore[no-untyped-def]
    """Work out where a chain is in the frame of its base.

    Args:
        links: the chain, as :class:`Links`.
        joints: (n,) positions.
        axes: (n, 3) gets the joints' axes.
        points: (n + 1, 3) gets a point of each axis, and the grasp point last.
        pointing: (3,) gets where the gripper points.
    """
    count = len(joints)
    turn, at, moved = np.zeros((3, 3)), np.zeros(3), np.empty((3, 3))
    turn[0, 0] = turn[1, 1] = turn[2, 2] = 1.0
    for n in range(count + 1):
        for i in range(3):
            at[i] += _row(turn, i, links.shifts[n, 0], links.shifts[n, 1], links.shifts[n, 2])
            points[n, i] = at[i]
        turn = _product(turn, links.turns[n])
        if n == count:
            break
        x, y, z = links.axes[n, 0], links.axes[n, 1], links.axes[n, 2]
        for i in range(3):
            axes[n, i] = _row(turn, i, x, y, z)
            if links.slides[n]:
                at[i] += axes[n, i] * joints[n]
        if not links.slides[n]:
            _turn(x, y, z, joints[n], moved)
            turn = _product(turn, moved)
    for i in range(3):
        pointing[i] = _row(turn, i, links.pointing[0], links.pointing[1], links.pointing[2])


@compiled
def _row(matrix, row, x, y, z):  # type: ignore[no-untyped-def]
    return matrix[row, 0] * x + matrix[row, 1] * y + matrix[row, 2] * z


@compiled
def _product(one, other):  # type: ignore[no-untyped-def]
    product = np.empty((3, 3))
    for i in range(3):
        for j in range(3):
            product[i, j] = _row(one, i, other[0, j], other[1, j], other[2, j])
    return product


@compiled
def _turn(x, y, z, angle, turn):  # type: ignore[no-untyped-def]
    """Write a turn by an angle about a unit vector x, y, z into a matrix."""
    c, s = np.cos(angle), np.sin(angle)
    rest = 1.0 - c
    turn[0, 0], turn[0, 1], turn[0, 2] = c + x * x * rest, x * y * rest - z * s, x * z * rest + y * s
    turn[1, 0], turn[1, 1], turn[1, 2] = y * x * rest + z * s, c + y * y * rest, y * z * rest - x * s
    turn[2, 0], turn[2, 1], turn[2, 2] = z * x * rest - y * s, z * y * rest + x * s, c + z * z * rest


@compiled
def descend(links, joints, target, wanted, weight):  # type: ignore[no-untyped-def]
    """Move joints, in place, so that the grasp point comes to a target and the gripper points somewhere.

    Args:
        links: the chain.
        joints: (n,) where to start.
        target: (3,) in the frame of the base, metres.
        wanted: (3,) unit vector.
        weight: of the direction, metres; 0: it does not matter.

    Returns:
        Distance from the target in metres, and how far the gripper is off its direction.
    """
    count = len(joints)
    axes, points, pointing = np.empty((count, 3)), np.empty((count + 1, 3)), np.empty(3)
    jacobian, error, change = np.empty((6, count)), np.empty(6), np.empty(count)
    far, off = np.inf, np.inf
    for step in range(_STEPS + 1):
        place(links, joints, axes, points, pointing)
        for i in range(3):
            error[i] = target[i] - points[count, i]
            error[3 + i] = weight * (wanted[i] - pointing[i])
        far = np.sqrt(error[0] ** 2 + error[1] ** 2 + error[2] ** 2)
        off = np.sqrt(error[3] ** 2 + error[4] ** 2 + error[5] ** 2) / weight if weight > 0 else 0.0
        if step == _STEPS or (far < _NEAR and off < _OFF):
            break
        _differentiate(links, axes, points, pointing, weight, jacobian)
        if _advance(links, joints, jacobian, error, change) < _STALLED:
            break
    return far, off


@compiled
def _differentiate(links, axes, points, pointing, weight, jacobian):  # type: ignore[no-untyped-def]
    """Work out how place and direction (6, n) change with the joints."""
    count = len(axes)
    for n in range(count):
        x, y, z = axes[n, 0], axes[n, 1], axes[n, 2]
        if links.slides[n]:
            jacobian[0, n], jacobian[1, n], jacobian[2, n] = x, y, z
            jacobian[3, n] = jacobian[4, n] = jacobian[5, n] = 0.0
            continue
        for first, a, b, c in (
            (0, points[count, 0] - points[n, 0], points[count, 1] - points[n, 1], points[count, 2] - points[n, 2]),
            (3, weight * pointing[0], weight * pointing[1], weight * pointing[2]),
        ):
            jacobian[first, n], jacobian[first + 1, n] = y * c - z * b, z * a - x * c
            jacobian[first + 2, n] = x * b - y * a


@compiled
def _advance(links, joints, jacobian, error, change):  # type: ignore[no-untyped-def]
    """Move joints by one damped step, in place; those that would leave their limits stay, the others do without them.

    Returns:
        By how much the joint moves that moves most.
    """
    count = len(joints)
    free = np.ones(count, dtype=np.bool_)
    scale, most = 0.0, 0.0
    for _ in range(count):
        most = _damped(jacobian, error, free, change)
        scale = min(1.0, _LARGEST / most) if most > 0 else 0.0
        stopped = False
        for n in range(count):
            there = joints[n] + scale * change[n]
            low, high = joints[n] <= links.lower[n], joints[n] >= links.upper[n]
            if free[n] and ((low and there < links.lower[n]) or (high and there > links.upper[n])):
                free[n], stopped = False, True
        if not stopped:
            break
    for n in range(count):
        joints[n] = min(max(joints[n] + scale * change[n], links.lower[n]), links.upper[n])
    return scale * most


@compiled
def _damped(jacobian, error, free, change):  # type: ignore[no-untyped-def]
    """Work out the damped least-squares change of the joints that are free; return the largest of them."""
    count = len(free)
    normal, right, most = np.empty((6, 6)), error.copy(), 0.0
    for i in range(6):
        for j in range(i + 1):
            normal[i, j] = _DAMPING if i == j else 0.0
            for n in range(count):
                if free[n]:
                    normal[i, j] += jacobian[i, n] * jacobian[j, n]
    _solve(normal, right)
    for n in range(count):
        change[n] = 0.0
        for i in range(6):
            if free[n]:
                change[n] += jacobian[i, n] * right[i]
        most = max(most, abs(change[n]))
    return most


@compiled
def _solve(matrix, right):  # type: ignore[no-untyped-def]
    """Solve a positive definite system of equations in place, by Cholesky's method."""
    count = len(right)
    for i in range(count):
        for j in range(i + 1):
            for k in range(j):
                matrix[i, j] -= matrix[i, k] * matrix[j, k]
            matrix[i, j] = np.sqrt(matrix[i, j]) if i == j else matrix[i, j] / matrix[j, j]
    for i in range(count):
        for k in range(i):
            right[i] -= matrix[i, k] * right[k]
        right[i] /= matrix[i, i]
    for i in range(count - 1, -1, -1):
        for k in range(i + 1, count):
            right[i] -= matrix[k, i] * right[k]
        right[i] /= matrix[i, i]


@compiled
def keeps_off(points, column):  # type: ignore[no-untyped-def]
    """Tell whether an arm keeps off the floor and its robot's own base, by its joints and the middles between them."""
    for n in range(1, len(points)):
        for share in (0.5, 1.0):
            z = points[n - 1, 2] + share * (points[n, 2] - points[n - 1, 2])
            x = points[n - 1, 0] + share * (points[n, 0] - points[n - 1, 0])
            y = points[n - 1, 1] + share * (points[n, 1] - points[n - 1, 1])
            if z < _FLOOR or (z < column.height - _SKIN and np.sqrt(x * x + y * y) < column.radius):
                return False
    return True


@compiled
def search(links, column, target, wanted, starts, found):  # type: ignore[no-untyped-def]
    """Find configurations that bring the grasp point to a target.

    Args:
        links: the chain.
        column: what it keeps off, as :class:`Column`.
        target: (3,) in the frame of the base, metres.
        wanted: (d, 3) where the gripper may point, the best first; looked through in this order. If it can point
            nowhere of these, any direction will do.
        starts: (s, n) where to start from.
        found: (m, n + 1) gets what is found, and after each configuration the number of its direction.

    Returns:
        How many have been found; no more are sought than fit.
    """
    count, number = len(links.lower), 0
    axes, points, pointing = np.empty((count, 3)), np.empty((count + 1, 3)), np.empty(3)
    joints = np.empty(count)
    known = links.pointing[0] != 0.0 or links.pointing[1] != 0.0 or links.pointing[2] != 0.0
    choices = len(wanted) if known else 0
    for choice in range(choices + 1):
        last = choice == choices  # whatever the direction, but not upwards
        weight = 0.0 if last else _TURNING
        for start in range(len(starts)):
            if number == len(found) or (last and number > 0):
                return number
            for n in range(count):
                joints[n] = starts[start, n]
            far, off = descend(links, joints, target, wanted[min(choice, len(wanted) - 1)], weight)
            if far >= _NEAR or off >= _OFF:
                continue
            place(links, joints, axes, points, pointing)
            if pointing[2] <= _UPWARDS and keeps_off(points, column):
                for n in range(count):
                    found[number, n] = joints[n]
                found[number, count] = choice
                number += 1
    return number
