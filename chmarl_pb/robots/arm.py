"""The humanoid's arm: named joints, fixed poses, and inverse kinematics in closed form.

Three axes cross in the shoulder and three in the wrist, one bends the elbow. So a place of the shoulder (the torso's
lift), a direction of the gripper (yaw, pitch) and a side to which the elbow points (swivel) leave one arm
configuration at most. ``Arm.solve`` works out a fixed grid of such choices at once and takes the most comfortable one:
no iteration, no randomness, no trace in the simulation. Lengths are metres, angles radians, quaternions (x, y, z, w).
"""

from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chmarl_pb.errors import AssetError
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.robots.motors import Array, Configuration, Motors, Postures, from_base
from chmarl_pb.robots.rounding import rounded
from chmarl_pb.world import Pose
from chmarl_pb.world.bullet import pybullet as p

__all__ = ["JOINTS", "REACH", "Arm", "Configuration"]

#: The movable joints, in the order of a configuration.
JOINTS = (
    "torso_lift",
    "shoulder_pitch",
    "shoulder_roll",
    "upper_arm_roll",
    "elbow_pitch",
    "forearm_roll",
    "wrist_pitch",
    "wrist_roll",
    "left_finger_slide",
    "right_finger_slide",
)

#: Links whose places are the arm's measures: the axes of shoulder, elbow and wrist, and the point between fingertips.
LINKS = ("shoulder", "forearm", "wrist", "grasp")

#: How far an open finger is from the closing plane.
OPEN = 0.05
_GAP = 0.008  # metres between an open finger and an object

#: Gripper pitch (down is positive) that a solution prefers.
BEST_PITCH = np.radians(45)

#: The grid of choices: torso lift, gripper pitch, gripper yaw off the line from the shoulder, elbow swivel (0 is
#: down, negative is outward).
_CHOICES = np.stack(
    np.meshgrid(
        np.linspace(-0.48, 0.30, 14),
        np.radians(np.arange(0, 91, 15)),
        np.radians((-40, -20, 0, 20, 40)),
        np.radians(np.arange(-120, 31, 25)),
        indexing="ij",
    ),
    axis=-1,
).reshape(-1, 4)


class Arm(Motors):
    """The torso lift, right arm and gripper of one humanoid body.

    Attributes:
        rest: arm tucked beside the trunk, out of the camera's picture, fingers closed.
        carry: hand in front of the chest, at (0.45, -0.12, 1.0) in the humanoid's frame.
        postures: in which it is taken along: drawn in low and high, and hanging down; with an object, also to the left
            and to the right of the trunk, and over the head. The last of both is all within the footprint that the
            lattice keeps free, with even the widest object of the benchmark.
        fingers: number of joints at the end of a configuration that do not move the hand.
        grasp_link: PyBullet link index of the point between the fingertips.
        grasp: where that point is in the link's inertial frame; None: at its origin.
    """

    rest: ClassVar[Configuration] = (0.0, -0.8, 0.0, 0.0, 2.35, 0.0, -1.35, 0.0, 0.0, 0.0)
    carry: ClassVar[Configuration] = (0.0, -0.029, -0.482, -0.512, 2.558, -0.919, -1.017, 0.365, 0.03, 0.03)
    postures: ClassVar[Postures] = Postures(
        empty=(
            rest,
            (-0.054, -0.599, 0.081, 0.024, 1.821, -0.53, -1.423, 0.536, 0.0, 0.0),
            (0.209, 0.392, 0.465, 1.087, 2.412, -1.416, 0.066, 0.043, 0.0, 0.0),
            (0.3, 0.0, 0.0, 0.0, 0.0, float(np.pi / 2), 0.0, 0.0, 0.0, 0.0),
        ),
        loaded=(
            carry,
            (0.148, -0.995, 0.546, -0.636, 1.629, -1.312, -0.589, 0.074, 0.03, 0.03),
            (0.0, 1.383, 0.535, 1.278, 1.621, -2.4, -1.161, -0.211, 0.03, 0.03),
            (0.149, -1.163, -0.342, -1.204, 1.849, -2.397, -1.453, -0.153, 0.03, 0.03),
            (0.184, 2.633, 0.7, 2.142, 2.552, 1.738, 0.262, 0.327, 0.03, 0.03),
            (-0.407, 2.78, 0.44, 0.038, 0.554, 0.817, -0.422, -0.763, 0.03, 0.03),
        ),
        between=(carry, (0.0, -0.8, 0.0, 0.0, *carry[4:])),  # the hand before the chest, the elbow drawn back
    )
    fingers: ClassVar[int] = 2
    grasp: ClassVar[Pose | None] = None

    def __init__(self, client: int, body: int, urdf: Path) -> None:
        """Look up the joints and measure the arm of a loaded robot.

        Args:
            client: PyBullet client id.
            body: body id of a robot with the joints ``JOINTS`` and the links ``LINKS``.
            urdf: its file, for messages.

        Raises:
            AssetError: it has not all of these joints and links.
        """
        count = p.getNumJoints(body, physicsClientId=client)
        infos = [p.getJointInfo(body, index, physicsClientId=client) for index in range(count)]
        joints = {info[1].decode(): info for info in infos}
        links = {info[12].decode(): info[0] for info in infos}
        if missing := [*({*JOINTS} - joints.keys()), *({*LINKS} - links.keys())]:
            raise AssetError(
                f"{urdf}: an arm needs the joints {', '.join(JOINTS)} and the links {', '.join(LINKS)}; "
                f"missing: {', '.join(sorted(missing))}"
            )
        indices, limits = [joints[name][0] for name in JOINTS], [joints[name][8:12] for name in JOINTS]
        super().__init__(client, body, indices, np.array(limits))
        self.grasp_link = links["grasp"]
        self._measure(links)

    def solve(self, target: ArrayLike, base: Pose) -> Configuration | None:
        """Find a configuration that brings the grasp point to a target, with the fingers open.

        The result depends on the arguments alone; the simulation is left untouched.

        Args:
            target: position (3,) in the world.
            base: pose of the humanoid's base.

        Returns:
            A configuration within the joint limits with the gripper level to straight down, or None.
        """
        point = from_base(target, base)
        best, least = None, np.inf
        for block, floor in _BLOCKS:
            if least <= floor:
                break
            poses, costs = self._postures(point, block)
            if len(poses) and costs.min() < least:
                best, least = poses[np.argmin(costs)], costs.min()
        return None if best is None else (*best.tolist(), OPEN, OPEN)

    def solutions(self, target: ArrayLike, base: Pose) -> Array:
        """Return all configurations (n, joints) of the grid that reach a target as :meth:`solve`'s, the best first."""
        poses, costs = self._postures(from_base(target, base), _CHOICES)
        return np.column_stack([poses, np.full((len(poses), 2), OPEN)])[np.argsort(costs, kind="stable")]

    def opening(self, width: float) -> Configuration:
        """Return where the fingers are when they reach for an object of a width in metres."""
        return (min(OPEN, max(self.carry[-1], width / 2) + _GAP),) * self.fingers

    def above(self, configurations: Array, height: float) -> Array:
        """Return configurations (n, joints) with the hand as much higher as the torso's lift lets it be."""
        raised = configurations.copy()
        raised[:, 0] = np.minimum(raised[:, 0] + height, self.upper[0])
        return raised

    def _measure(self, links: dict[str, int]) -> None:
        """Read the shoulder's place and the arm's lengths off the body with all joints at zero."""
        before = self.configuration()
        self.set((0.0,) * len(JOINTS))
        base, turn = p.getBasePositionAndOrientation(self.body, physicsClientId=self.client)
        rotation = np.reshape(p.getMatrixFromQuaternion(turn), (3, 3))
        indices = [links[name] for name in LINKS]
        states = p.getLinkStates(self.body, indices, computeForwardKinematics=True, physicsClientId=self.client)
        places = np.round((np.array([state[4] for state in states]) - base) @ rotation, 6)
        self._shoulder = places[0]
        self._upper, self._fore, self._hand = np.linalg.norm(np.diff(places, axis=0), axis=1)
        self.set(before)

    def _postures(self, point: Array, choices: Array) -> tuple[Array, Array]:
        """Return the allowed postures (n, 8) of some choices for a point in the humanoid's frame, and costs (n,)."""
        lift, pitch, offset = choices[:, :3].T
        shoulder = self._shoulder + lift[:, None] * (0.0, 0.0, 1.0)
        yaw = np.arctan2(*(point - self._shoulder)[1::-1]) + offset
        hand = _hand_frames(yaw, pitch)
        span = point + self._hand * hand[:, :, 2] - shoulder
        length = np.linalg.norm(span, axis=1)
        bend = (length**2 - self._upper**2 - self._fore**2) / (2 * self._upper * self._fore)
        keep = np.flatnonzero((bend < 0.9995) & (bend > np.cos(self.upper[4])) & (np.hypot(*span.T[:2]) > 1e-6))
        shoulder, span, hand, choice = shoulder[keep], span[keep], hand[keep], choices[keep]
        elbow = np.arccos(bend[keep])
        upper, fore = self._limbs(span, length[keep], choice[:, 3])
        arm = _frames(fore, -upper)
        wrist = np.swapaxes(arm @ _turns_y(-elbow), 1, 2) @ hand
        poses = rounded(np.column_stack([choice[:, 0], _shoulder_angles(arm), elbow, _wrist_angles(wrist)]))
        joint = shoulder + self._upper * upper
        allowed = ((poses >= self.lower[:8]) & (poses <= self.upper[:8])).all(axis=1)
        allowed &= _clear(joint, shoulder + span, point, choice[:, 0])
        poses, choice, above = poses[allowed], choice[allowed], joint[allowed, 2] - point[2]
        return poses, rounded(self._costs(poses, choice, offset[keep][allowed], above))

    def _limbs(self, span: Array, length: Array, swivel: Array) -> tuple[Array, Array]:
        """Return the unit directions of upper arm and forearm that bridge shoulder to wrist, elbow at a swivel."""
        ahead = span / length[:, None]
        below = _unit(ahead * ahead[:, 2:] - (0.0, 0.0, 1.0))
        elbow = np.cos(swivel)[:, None] * below + np.sin(swivel)[:, None] * np.cross(ahead, below)
        cosine = (self._upper**2 + length**2 - self._fore**2) / (2 * self._upper * length)
        upper = cosine[:, None] * ahead + np.sqrt(1 - cosine**2)[:, None] * elbow
        return upper, (span - self._upper * upper) / self._fore

    def _costs(self, poses: Array, choice: Array, offset: Array, above: Array) -> Array:
        """Return how uncomfortable postures are.

        Args:
            poses: postures, shape (n, 8).
            choice: their rows of the grid.
            offset: gripper yaw off the line from the shoulder.
            above: height of the elbow above the target; the arm should come from above.
        """
        middle, half = (self.upper + self.lower)[1:8] / 2, (self.upper - self.lower)[1:8] / 2
        strain = (((poses[:, 1:] - middle) / half) ** 8).sum(axis=1)
        effort = (choice[:, 1] - BEST_PITCH) ** 2 + 0.5 * offset**2 + choice[:, 0] ** 2
        cost: Array = effort + strain + 4.0 * np.maximum(0.05 - above, 0.0) + 0.1 * (choice[:, 3] + 0.8) ** 2
        return cost


def _blocks(choices: Array) -> list[tuple[Array, float]]:
    """Return choices in blocks, the most comfortable first, each with a cost that none of it and none after is below.

    It is what :meth:`Arm._costs` adds up without the terms that depend on the target, none of which is negative.
    """
    lift, pitch, offset, swivel = choices.T
    costs = (pitch - BEST_PITCH) ** 2 + 0.5 * offset**2 + lift**2 + 0.1 * (swivel + 0.8) ** 2
    order = np.argsort(costs, kind="stable")
    blocks = np.split(order, (160, 500, 1200))
    return [(choices[block], float(costs[block[0]]) - 1e-9) for block in blocks]  # 1e-9: rounding


_BLOCKS = _blocks(_CHOICES)


def _hand_frames(yaw: Array, pitch: Array) -> Array:
    """Return hand rotations (n, 3, 3): the gripper points along -z at a yaw and a pitch down, its y axis is level."""
    cy, sy, cp, sp = np.cos(yaw), np.sin(yaw), np.cos(pitch), np.sin(pitch)
    out = np.stack([cp * cy, cp * sy, -sp], axis=1)
    level = np.stack([-sy, cy, np.zeros_like(sy)], axis=1)
    return np.stack([np.cross(out, level), level, -out], axis=2)


def _frames(forward: Array, up: Array) -> Array:
    """Return rotations (n, 3, 3) with z = ``up`` and x as near to ``forward`` as can be."""
    x = _unit(forward - (forward * up).sum(axis=1, keepdims=True) * up)
    return np.stack([x, np.cross(up, x), up], axis=2)


def _turns_y(angle: Array) -> Array:
    """Return rotations (n, 3, 3) about y."""
    c, s, zero, one = np.cos(angle), np.sin(angle), np.zeros_like(angle), np.ones_like(angle)
    return np.stack([c, zero, s, zero, one, zero, -s, zero, c], axis=1).reshape(-1, 3, 3)


def _shoulder_angles(turn: Array) -> Array:
    """Return pitch, roll and upper arm roll (n, 3) of rotations Ry(-pitch) Rx(roll) Rz(upper arm roll)."""
    pitch = -np.arctan2(turn[:, 0, 2], turn[:, 2, 2])
    return np.column_stack([pitch, -np.arcsin(turn[:, 1, 2].clip(-1, 1)), np.arctan2(turn[:, 1, 0], turn[:, 1, 1])])


def _wrist_angles(turn: Array) -> Array:
    """Return forearm roll, pitch and roll (n, 3) of rotations Rz(forearm roll) Ry(-pitch) Rx(roll)."""
    roll = np.arctan2(turn[:, 2, 1], turn[:, 2, 2])
    return np.column_stack([np.arctan2(turn[:, 1, 0], turn[:, 0, 0]), np.arcsin(turn[:, 2, 0].clip(-1, 1)), roll])


def _clear(elbow: Array, wrist: Array, grasp: Array, lift: Array) -> NDArray[np.bool_]:
    """Tell which arms keep off the robot's own base, column, trunk and head.

    The robot is taken as three upright cylinders: the base up to 0.37 m, the column, and all above the trunk's
    lower edge, which rises with the lift. Each counts with the arm's own thickness added.
    """
    clear = np.ones(len(lift), dtype=bool)
    for point in (elbow, (elbow + wrist) / 2, wrist, (wrist + grasp) / 2, np.broadcast_to(grasp, wrist.shape)):
        height = point[:, 2]
        radius = np.where(height < 0.37, 0.28, np.where(height < 0.74 + lift, 0.12, 0.20))
        clear &= np.hypot(point[:, 0], point[:, 1]) > radius
    return clear


def _unit(vectors: Array) -> Array:
    """Scale vectors (n, 3) to length 1."""
    units: Array = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    return units
