"""The joints of an arm: where they are, their limits, and their motors."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chmarl_pb.robots.rounding import rounded
from chmarl_pb.world import Pose
from chmarl_pb.world.bullet import pybullet as p

Array: TypeAlias = NDArray[np.float64]
Configuration: TypeAlias = tuple[float, ...]


@dataclass(frozen=True)
class Postures:
    """Configurations in which an arm is taken along on drives.

    Attributes:
        empty: with nothing in the gripper, the usual one first.
        loaded: with an object in it, the usual one first.
        between: some more, on the way from a place to ``empty``.
    """

    empty: tuple[Configuration, ...]
    loaded: tuple[Configuration, ...]
    between: tuple[Configuration, ...] = ()


def from_base(target: ArrayLike, base: Pose) -> Array:
    """Return a point (3,) of the world in the frame of a base, metres."""
    rotation = np.reshape(p.getMatrixFromQuaternion(base[1]), (3, 3))
    return rounded((np.asarray(target, dtype=float) - base[0]) @ rotation)


class Motors:
    """Some joints of one body, moved together.

    Attributes:
        client: PyBullet client id.
        body: PyBullet body id.
        indices: PyBullet joint index of each joint, in the order of a configuration.
        lower: lower limits.
        upper: upper limits.
        speeds: highest speeds.
    """

    def __init__(self, client: int, body: int, indices: Sequence[int], limits: Array) -> None:
        """Take joints.

        Args:
            client: PyBullet client id.
            body: PyBullet body id.
            indices: PyBullet joint index of each joint.
            limits: (joints, 4) lower and upper limit, highest force and highest speed.
        """
        self.client, self.body, self.indices = client, body, tuple(indices)
        self.lower, self.upper, efforts, self.speeds = np.asarray(limits, dtype=float).T
        self._efforts = efforts.tolist()

    def set(self, configuration: Configuration) -> None:
        """Put all joints into a configuration at once, at rest."""
        for index, value in zip(self.indices, configuration, strict=True):
            p.resetJointState(self.body, index, value, physicsClientId=self.client)

    def drive(self, configuration: ArrayLike, velocities: ArrayLike | None = None) -> None:
        """Command the joints' motors to a configuration that moves at some velocities, none if they are left out."""
        speeds = [0.0] * len(self.indices) if velocities is None else np.asarray(velocities, dtype=float).tolist()
        p.setJointMotorControlArray(
            self.body,
            self.indices,
            p.POSITION_CONTROL,
            targetPositions=np.asarray(configuration, dtype=float).tolist(),
            targetVelocities=speeds,
            forces=self._efforts,
            physicsClientId=self.client,
        )

    def configuration(self) -> Configuration:
        """Return the joints' present positions."""
        states = p.getJointStates(self.body, self.indices, physicsClientId=self.client)
        return tuple(state[0] for state in states)
