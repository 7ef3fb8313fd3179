"""The humanoid's arm: named joints, fixed poses, and inverse kinematics in closed form.

Three axes cross in the shoulder and three in the wrist, one bends the elbow. So a place of the shoulder (the torso's
lift), a direction of the gripper (yaw, pitch) and a side to which the elbow points (swivel) leave one arm
configuration at most. ``Arm.solve`` works out a fixed grid of such choices at once and takes the most comfortable one:
no iteration, no randomness, no trace in the simulation. Lengths are metres, angles radians, quaternions (x, y, z, w).
"""

from pathlib import Path
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from chmarl_pb.errors import AssetError
from chmarl_pb.navigation.reach import REACH
from chmarl_pb.robots.motors import Array, Configuration, Motors, Postures, from_base
from chmarl_pb.robots.postures import BEST_PITCH, Measures, find_all, find_best
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


def _floors(choices: Array) -> Array:
    """Return costs (n,) that postures of choices are never below.

    It is what :func:`chmarl_pb.robots.postures.find_posture` adds up without the terms that depend on the target, none
    of which is negative.
    """
    lift, pitch, offset, swivel = choices.T
    costs: Array = (pitch - BEST_PITCH) ** 2 + 0.5 * offset**2 + lift**2 + 0.1 * (swivel + 0.8) ** 2
    return costs - 1e-9  # rounding


_ORDER = np.argsort(_floors(_CHOICES), kind="stable")  # the most comfortable first
_COMFORTABLE, _FLOORS = _CHOICES[_ORDER], _floors(_CHOICES)[_ORDER]


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
        best = np.empty(len(JOINTS) - self.fingers)
        cost = find_best(from_base(target, base), _COMFORTABLE, _FLOORS, self._measures, best)
        return (*best.tolist(), OPEN, OPEN) if np.isfinite(cost) else None

    def solutions(self, target: ArrayLike, base: Pose) -> Array:
        """Return all configurations (n, joints) of the grid that reach a target as :meth:`solve`'s, the best first."""
        found, costs = np.full((len(_CHOICES), len(JOINTS)), OPEN), np.empty(len(_CHOICES))
        find_all(from_base(target, base), _CHOICES, self._measures, found, costs)
        best_first = np.argsort(costs, kind="stable")
        return found[best_first[: np.isfinite(costs).sum()]]

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
        lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
        self._measures = Measures(places[0], lengths, self.lower[: -self.fingers], self.upper[: -self.fingers])
        self.set(before)
