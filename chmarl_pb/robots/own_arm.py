"""Arms of robot files in a world: any chain of joints, its inverse kinematics solved numerically."""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from chmarl_pb.robots.arm import Arm
from chmarl_pb.robots.arm_boxes import ArmBoxes, Parts
from chmarl_pb.robots.arm_model import ArmModel
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.motors import Array, Configuration, Motors, Postures, from_base
from chmarl_pb.world import UPRIGHT, Pose
from chmarl_pb.world.bullet import pybullet as p

_BEST_OF = 8  # configurations of which a single one is chosen


class OwnArm(Motors):
    """The arm of one body; see :class:`chmarl_pb.robots.arm.Arm` for what it can do.

    Attributes:
        rest: configuration with nothing in the gripper.
        carry: configuration with an object in it.
        postures: in which it is taken along.
        fingers: number of joints at the end of a configuration that do not move the hand.
        grasp_link: PyBullet link index of the hand.
        grasp: where the point between the fingertips is in the hand's inertial frame.
    """

    def __init__(self, client: int, body: int, model: ArmModel) -> None:
        """Look up the joints of a loaded robot.

        Args:
            client: PyBullet client id.
            body: body id.
            model: what is known of the arm.
        """
        infos = [p.getJointInfo(body, n, physicsClientId=client) for n in range(p.getNumJoints(body, client))]
        numbers = {info[1].decode(): info[0] for info in infos}
        limits = np.array([(joint.lower, joint.upper, joint.effort, joint.speed) for joint in model.joints])
        still = slice(model.moving + model.fingers, None)
        limits[still, 0] = limits[still, 1] = model.rest[still]
        super().__init__(client, body, [numbers[joint.name] for joint in model.joints], limits)
        self._model = model
        self.rest, self.carry = model.rest, model.carry
        self.fingers = len(model.joints) - model.moving
        self.grasp_link = next(info[0] for info in infos if info[12].decode() == model.hand)
        inertial = p.getLinkState(body, self.grasp_link, physicsClientId=client)[2:4]
        self.grasp: Pose = p.multiplyTransforms(*p.invertTransform(*inertial), model.grasp, UPRIGHT)
        self.postures = _postures(model)

    def solve(self, target: ArrayLike, base: Pose) -> Configuration | None:
        """Find a configuration that brings the grasp point to a target, with the fingers open.

        The result depends on the arguments alone; the simulation is left untouched.

        Args:
            target: position (3,) in the world.
            base: pose of the robot's base.

        Returns:
            A configuration within the joint limits, or None.
        """
        found = self._model.space.solve(from_base(target, base), _BEST_OF)
        return (*found[0].tolist(), *self._model.open) if len(found) else None

    def solutions(self, target: ArrayLike, base: Pose) -> Array:
        """Return configurations (n, joints) that reach a target as :meth:`solve`'s, the best first."""
        found = self._model.space.solve(from_base(target, base))
        return np.column_stack([found, np.tile(self._model.open, (len(found), 1))])

    def opening(self, _width: float) -> Configuration:
        """Return where the joints that do not move the hand are when it reaches for an object, of whatever width."""
        return self._model.open

    def above(self, configurations: Array, height: float) -> Array:
        """Return configurations (n, joints) with the hand as much higher as can be, turned as little as can be."""
        moving, rest = np.split(configurations, [self._model.moving], axis=1)
        return np.column_stack([self._model.space.above(moving, height), rest])


AnyArm: TypeAlias = Arm | OwnArm


def load_arm(model: RobotModel, client: int, body: int) -> tuple[AnyArm, ArmBoxes]:
    """Return the arm of a loaded robot, and its shape.

    Raises:
        AssetError: it has no arm that this package knows.
    """
    own = model.arm
    if own is None:
        return Arm(client, body, model.urdf), ArmBoxes(client, body)
    names = tuple(joint.name for joint in own.joints)
    parts = Parts(names, own.hand, own.grasp, own.finger_links, own.outer_links, lifts=False)
    return OwnArm(client, body, own), ArmBoxes(client, body, parts)


def _postures(model: ArmModel) -> Postures:
    """Return rest and carry, and with either hand the postures with the grasp point near to the base, low to high."""
    near = [row[np.isfinite(row[:, 0])][:1] for row in model.space.nodes]
    drawn_in = [tuple(row[0].tolist()) for row in near if len(row)][::4]
    ends = model.rest[model.moving :], model.carry[model.moving :]
    empty, loaded = ([(*posture, *fingers) for posture in drawn_in] for fingers in ends)
    both = [(*one[: model.moving], *fingers) for one, fingers in zip((model.carry, model.rest), ends, strict=True)]
    return Postures((model.rest, both[0], *empty), (model.carry, both[1], *loaded))
