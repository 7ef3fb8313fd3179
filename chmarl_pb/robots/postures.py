"""The humanoid's inverse kinematics, compiled: the one posture that a choice of what is left free gives, and its cost.

A choice is (4,): torso lift in metres; gripper pitch (down is positive), gripper yaw off the line from the shoulder
and elbow swivel (0 is down, negative is outward) in radians. A posture is (8,): torso lift, shoulder pitch and roll,
upper arm roll, elbow pitch, forearm roll, wrist pitch and roll. Vectors are (x, y, z) in the frame of the base.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled

#: Gripper pitch (down is positive) that a solution prefers.
BEST_PITCH = math.radians(45)

_PER_UNIT = 1e6  # as :func:`chmarl_pb.robots.rounding.rounded` rounds
_STRAIGHT = 0.9995  # cosine of the elbow's bend from which on an arm counts as stretched too far
_ELBOW = 4  # its place in a posture


class Measures(NamedTuple):
    """What is known of an arm.

    Attributes:
        shoulder: (3,) its place with all joints at zero, metres.
        lengths: (3,) of the upper arm, of the forearm, and from the wrist to the grasp point, metres.
        lower: (8,) limits of a posture.
        upper: (8,) limits of a posture.
    """

    shoulder: NDArray[np.float64]
    lengths: NDArray[np.float64]
    lower: NDArray[np.float64]
    upper: NDArray[np.float64]


@compiled
def find_best(point, choices, floors, measures, best):  # type: ignore[no-untyped-def]
    """Set ``best`` (8,) to the posture of the least cost that brings the grasp point to a point; return the cost.

    Args:
        point: (3,) in the frame of the base.
        choices: (n, 4) to choose from.
        floors: (n,) costs that neither that choice nor a later one is below.
        measures: of the arm.
        best: is set; it is not if the cost is infinite, as none reaches the point.
    """
    least, posture = np.inf, np.empty(8)
    for number in range(len(choices)):
        if least <= floors[number]:
            break
        cost = find_posture(point, choices[number], measures, posture)
        if cost < least:
            least = cost
            for joint in range(8):  # as a whole, it takes Numba twice as long to compile all of this
                best[joint] = posture[joint]
    return least


@compiled
def find_all(point, choices, measures, postures, costs):  # type: ignore[no-untyped-def]
    """Set ``postures`` (n, 8) and ``costs`` (n,) for choices (n, 4), see :func:`find_posture`."""
    for number in range(len(choices)):
        costs[number] = find_posture(point, choices[number], measures, postures[number])


@compiled
def find_posture(point, choice, measures, posture):  # type: ignore[no-untyped-def]
    """Set ``posture`` (8,) to the one of a choice with the grasp point at a point (3,); return how uncomfortable it is.

    Infinitely so if there is none, beyond the limits, or where the arm comes into the robot's own body.
    """
    lift, pitch, yaw_off, swivel = choice
    first, second, third = measures.lengths
    grasp = (point[0], point[1], point[2])
    shoulder = (measures.shoulder[0], measures.shoulder[1], measures.shoulder[2] + lift)
    out, level = _hand(math.atan2(point[1] - shoulder[1], point[0] - shoulder[0]) + yaw_off, pitch)
    wrist = _along(grasp, -third, out)
    span = _along(wrist, -1.0, shoulder)
    length = math.sqrt(_dot(span, span))
    bend = (length**2 - first**2 - second**2) / (2 * first * second)
    if not math.cos(measures.upper[_ELBOW]) < bend < _STRAIGHT or math.hypot(span[0], span[1]) <= 1e-6:
        return np.inf
    upper_arm, forearm = _limbs(span, length, swivel, first, second)
    elbow = _along(shoulder, first, upper_arm)
    _set_angles(posture, lift, upper_arm, forearm, math.acos(bend), out, level)
    for joint in range(8):
        if not measures.lower[joint] <= posture[joint] <= measures.upper[joint]:
            return np.inf
    if not _is_clear(elbow, wrist, grasp, lift):
        return np.inf
    effort = (pitch - BEST_PITCH) ** 2 + 0.5 * yaw_off**2 + lift**2 + 0.1 * (swivel + 0.8) ** 2
    # The arm should come from above.
    return _rounded(effort + _strain(posture, measures) + 4.0 * max(0.05 - (elbow[2] - grasp[2]), 0.0))


@compiled
def _hand(yaw, pitch):  # type: ignore[no-untyped-def]
    """Return where a gripper points at a yaw and a pitch down, and its level axis."""
    cy, sy, cp, sp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.sin(pitch)
    return (cp * cy, cp * sy, -sp), (-sy, cy, 0.0)


@compiled
def _limbs(span, length, swivel, first, second):  # type: ignore[no-untyped-def]
    """Return the unit directions of upper arm and forearm that bridge shoulder to wrist, elbow at a swivel."""
    ahead = _scaled(1.0 / length, span)
    below = _unit(_along(_scaled(ahead[2], ahead), -1.0, (0.0, 0.0, 1.0)))
    elbow = _along(_scaled(math.cos(swivel), below), math.sin(swivel), _cross(ahead, below))
    cosine = (first**2 + length**2 - second**2) / (2 * first * length)
    upper_arm = _along(_scaled(cosine, ahead), math.sqrt(1 - cosine**2), elbow)
    return upper_arm, _scaled(1.0 / second, _along(span, -first, upper_arm))


@compiled
def _set_angles(posture, lift, upper_arm, forearm, elbow, out, level):  # type: ignore[no-untyped-def]
    """Set a posture from the directions of its limbs.

    The upper arm's frame has z against its direction and x as near to the forearm as can be. The shoulder turns by
    Ry(-pitch) Rx(roll) Rz(upper arm roll), the elbow by Ry(-elbow), the wrist by Rz(forearm roll) Ry(-pitch) Rx(roll).
    """
    z = _scaled(-1.0, upper_arm)
    x = _unit(_along(forearm, -_dot(forearm, z), z))
    y = _cross(z, x)
    c, s = math.cos(elbow), math.sin(elbow)
    bent_x, bent_z = _along(_scaled(c, x), s, z), _along(_scaled(c, z), -s, x)
    hand_x, hand_z = _cross(out, level), _scaled(-1.0, out)
    posture[0] = lift
    posture[1] = -math.atan2(z[0], z[2])
    posture[2] = -math.asin(max(-1.0, min(1.0, z[1])))
    posture[3] = math.atan2(x[1], y[1])
    posture[4] = elbow
    posture[5] = math.atan2(_dot(y, hand_x), _dot(bent_x, hand_x))
    posture[6] = math.asin(max(-1.0, min(1.0, _dot(bent_z, hand_x))))
    posture[7] = math.atan2(_dot(bent_z, level), _dot(bent_z, hand_z))
    for joint in range(8):
        posture[joint] = _rounded(posture[joint])


@compiled
def _strain(posture, measures):  # type: ignore[no-untyped-def]
    """Return what joints cost that are near to their limits."""
    strain = 0.0
    for joint in range(1, 8):
        lower, upper = measures.lower[joint], measures.upper[joint]
        off = (posture[joint] - (upper + lower) / 2) / ((upper - lower) / 2)
        strain += off**8
    return strain


@compiled
def _is_clear(elbow, wrist, grasp, lift):  # type: ignore[no-untyped-def]
    """Tell whether an arm keeps off the robot's own base, column, trunk and head.

    The robot is taken as three upright cylinders: the base up to 0.37 m, the column, and all above the trunk's
    lower edge, which rises with the lift. Each counts with the arm's own thickness added.
    """
    fore, hand = _scaled(0.5, _along(elbow, 1.0, wrist)), _scaled(0.5, _along(wrist, 1.0, grasp))
    for point in (elbow, fore, wrist, hand, grasp):
        radius = 0.28 if point[2] < 0.37 else (0.12 if point[2] < 0.74 + lift else 0.20)
        if math.hypot(point[0], point[1]) <= radius:
            return False
    return True


@compiled
def _rounded(value):  # type: ignore[no-untyped-def]
    return np.rint(value * _PER_UNIT) / _PER_UNIT + 0.0  # -0.0 becomes 0.0


@compiled
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _scaled(factor, a):  # type: ignore[no-untyped-def]
    return factor * a[0], factor * a[1], factor * a[2]


@compiled
def _along(start, distance, direction):  # type: ignore[no-untyped-def]
    """Return the vector from a start so far along a direction."""
    return (
        start[0] + distance * direction[0],
        start[1] + distance * direction[1],
        start[2] + distance * direction[2],
    )


@compiled
def _unit(a):  # type: ignore[no-untyped-def]
    return _scaled(1.0 / math.sqrt(_dot(a, a)), a)
