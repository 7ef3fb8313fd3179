"""What PyBullet holds of a world: its bodies, moved, gripped and settled one by one.

Only an object that is being put down or carried is dynamic; all others are frozen (mass 0) where they stand.
So nothing drifts, a settle touches one body, and its result is the same after any history.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.homes.home import Home
from chmarl_pb.world.bodies import UPRIGHT, Pose, Vector, link_names, loaded_graspables, loaded_home, yaw_quaternion
from chmarl_pb.world.bullet import pybullet
from chmarl_pb.world.client import Client, Uncopied

TIME_STEP = 1 / 240  # seconds
_DROP = 0.004  # metres above a surface from which an object is let go
_STILL = 1e-2  # m/s and rad/s below which an object counts as at rest; contacts may leave it a jitter of 6e-3
_LONGEST_SETTLE = 240  # simulation steps
_UPRIGHT = np.cos(np.radians(15))
_RAYS = 10_000  # of one call; PyBullet takes 16,384
_GRIP_FORCE = 200  # newtons


@dataclass(frozen=True)
class RobotBody:
    """What physics knows of a robot.

    Attributes:
        body: PyBullet body id.
        joints: PyBullet joint index of each of its movable joints.
        grasp_link: PyBullet link index of its hand; None if it cannot grasp.
        grasp: the frame between its fingertips in the hand's inertial frame; None: the hand's own frame, in which it
            has its inertial frame, too.
    """

    body: int
    joints: Sequence[int] = ()
    grasp_link: int | None = None
    grasp: Pose | None = None


class Physics(Uncopied):
    """One PyBullet client with a home, the objects of every graspable class, and the robots.

    Attributes:
        client: PyBullet client id.
        home: body id of the home.
        links: name of a part of the home -> PyBullet link index.
        objects: name -> what is known of each object, in the catalogue's order.
        robots: name -> what is known of each robot.
    """

    def __init__(self, home: Home):
        """Load a home and the objects.

        Raises:
            HomeError: PyBullet cannot load the home.
            AssetError: the URDF of an object cannot be used.
        """
        self._connection = Client()
        self.client = self._connection.number
        self.robots: dict[str, RobotBody] = {}
        self._constraints: dict[str, tuple[int, str]] = {}  # robot -> constraint, object
        try:
            pybullet.setGravity(0, 0, -9.81, physicsClientId=self.client)
            pybullet.setPhysicsEngineParameter(
                fixedTimeStep=TIME_STEP, deterministicOverlappingPairs=1, physicsClientId=self.client
            )
            with loaded_home(self.client, home) as body:
                self.home = body
            self.links = {name: number for number, name in enumerate(link_names(self.client, self.home))}
            with loaded_graspables(self.client, home.catalog) as objects:
                self.objects = objects
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Disconnect the client; closing twice is allowed."""
        self._connection.close()
        self.client = -1

    def step(self) -> None:
        """Advance by ``TIME_STEP``."""
        pybullet.stepSimulation(physicsClientId=self.client)

    # Where bodies are

    def move_robot(self, name: str, base: Pose) -> None:
        """Move a robot's base."""
        pybullet.resetBasePositionAndOrientation(self.robots[name].body, *base, physicsClientId=self.client)

    def set_joints(self, name: str, joints: Sequence[float]) -> None:
        """Put a robot's joints into a configuration at once, at rest."""
        robot = self.robots[name]
        for index, value in zip(robot.joints, joints, strict=True):
            pybullet.resetJointState(robot.body, index, value, physicsClientId=self.client)

    def read_joints(self, name: str) -> tuple[float, ...]:
        """Return the present positions of a robot's movable joints."""
        robot = self.robots[name]
        if not robot.joints:
            return ()
        states = pybullet.getJointStates(robot.body, robot.joints, physicsClientId=self.client)
        return tuple(state[0] for state in states)

    def read_base(self, name: str) -> Pose:
        """Return the present pose of a robot's base."""
        pose: Pose = pybullet.getBasePositionAndOrientation(self.robots[name].body, physicsClientId=self.client)
        return pose

    def grasp_pose(self, name: str) -> Pose:
        """Return position and orientation of the point between a robot's fingertips."""
        robot = self.robots[name]
        state = pybullet.getLinkState(
            robot.body, robot.grasp_link, computeForwardKinematics=True, physicsClientId=self.client
        )
        if robot.grasp is None:
            return state[4], state[5]
        pose: Pose = pybullet.multiplyTransforms(state[0], state[1], *robot.grasp)
        return pose

    def move_object(self, name: str, pose: Pose | None) -> None:
        """Move an object's bottom centre to a pose; None: out of the home."""
        thing = self.objects[name]
        centre, quaternion = thing.parking, UPRIGHT
        if pose is not None:
            centre, _ = pybullet.multiplyTransforms(*pose, thing.inertial, UPRIGHT)
            quaternion = pose[1]
        pybullet.resetBasePositionAndOrientation(thing.body, centre, quaternion, physicsClientId=self.client)

    def read_object(self, name: str) -> Pose:
        """Return the present pose of an object's bottom centre."""
        thing = self.objects[name]
        centre, quaternion = pybullet.getBasePositionAndOrientation(thing.body, physicsClientId=self.client)
        back = tuple(-value for value in thing.inertial)
        position, _ = pybullet.multiplyTransforms(centre, quaternion, back, UPRIGHT)
        return position, quaternion

    # Holding: a fixed constraint between a robot's grasp link and an object

    def grip(self, robot: str, name: str, pose: Pose) -> None:
        """Close a robot's gripper, where it is now, on an object whose bottom centre is at a pose."""
        body, thing = self.robots[robot], self.objects[name]
        pivot, turn = self._in_object(name, pose, self.grasp_pose(robot))
        (x, y, z), frame = body.grasp or ((0, 0, 0), UPRIGHT)
        constraint = pybullet.createConstraint(
            body.body, body.grasp_link, thing.body, -1, pybullet.JOINT_FIXED, (0, 0, 0), (x, y, z), pivot, frame,
            turn, physicsClientId=self.client,
        )  # fmt: skip
        pybullet.changeConstraint(constraint, maxForce=_GRIP_FORCE, physicsClientId=self.client)
        self._constraints[robot] = constraint, name

    def level(self, robot: str, pose: Pose) -> None:
        """Turn the object in a robot's gripper towards a pose of its bottom centre."""
        constraint, name = self._constraints[robot]
        pivot, turn = self._in_object(name, pose, self.grasp_pose(robot))
        pybullet.changeConstraint(
            constraint, jointChildPivot=pivot, jointChildFrameOrientation=turn, maxForce=_GRIP_FORCE,
            physicsClientId=self.client,
        )  # fmt: skip

    def release(self, robot: str) -> None:
        """Open a robot's gripper."""
        if robot in self._constraints:
            constraint, _ = self._constraints.pop(robot)
            pybullet.removeConstraint(constraint, physicsClientId=self.client)

    def _in_object(self, name: str, pose: Pose, grasp: Pose) -> Pose:
        """Return a pose of the world in the inertial frame of an object whose bottom centre is at a pose."""
        centre, turn = pybullet.multiplyTransforms(*pose, self.objects[name].inertial, UPRIGHT)
        inside: Pose = pybullet.multiplyTransforms(*pybullet.invertTransform(centre, turn), *grasp)
        return inside

    # Letting go

    def thaw(self, name: str, solid: bool = True) -> None:
        """Make an object dynamic, at rest; one that is not solid passes through other things until frozen."""
        thing = self.objects[name]
        pybullet.changeDynamics(thing.body, -1, mass=thing.mass, physicsClientId=self.client)
        # After changeDynamics, which sets PyBullet's default filter whenever it changes the mass.
        mask = -1 if solid else 0
        pybullet.setCollisionFilterGroupMask(thing.body, -1, int(solid), mask, physicsClientId=self.client)
        pybullet.resetBaseVelocity(thing.body, (0, 0, 0), (0, 0, 0), physicsClientId=self.client)

    def freeze(self, name: str) -> None:
        """Make an object immovable where it is."""
        body = self.objects[name].body
        pybullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self.client)
        pybullet.changeDynamics(body, -1, mass=0, physicsClientId=self.client)

    def set_down(self, name: str, position: Vector, yaw: float, receptacle: str) -> Pose | None:
        """Let an object go just above a place and let physics settle it.

        Returns:
            Where it came to rest, if it stands upright and the receptacle carries it, by contact; else None.
        """
        x, y, z = position
        self.move_object(name, ((x, y, z + _DROP), yaw_quaternion(yaw)))
        self.thaw(name)
        still = self._settle(name)
        settled = self.read_object(name)
        carried = still and _tilt_cosine(settled[1]) > _UPRIGHT and self.rests_on(name, receptacle)
        self.freeze(name)
        return settled if carried else None

    def tops(self, points: NDArray[np.floating], above: float) -> NDArray[np.float64]:
        """Return the height (n,) of what a ray meets that falls from a height on each of some points (n, 2), metres."""
        starts = [(x, y, above) for x, y in points.tolist()]
        ends = [(x, y, 0.0) for x, y, _ in starts]
        heights: list[float] = []
        for first in range(0, len(starts), _RAYS):
            part = slice(first, first + _RAYS)
            hits = pybullet.rayTestBatch(starts[part], ends[part], physicsClientId=self.client)
            heights += [hit[3][2] if hit[0] >= 0 else 0.0 for hit in hits]
        return np.array(heights)

    def _settle(self, name: str) -> bool:
        body, quiet_steps = self.objects[name].body, 0
        for _ in range(_LONGEST_SETTLE):
            self.step()
            velocity = np.abs(pybullet.getBaseVelocity(body, physicsClientId=self.client)).max()
            quiet_steps = quiet_steps + 1 if velocity < _STILL else 0
            if quiet_steps == 5:
                return True
        return False

    def rests_on(self, name: str, receptacle: str) -> bool:
        """Return whether a receptacle carries an object: a contact that pushes it upwards."""
        contacts = pybullet.getContactPoints(
            self.objects[name].body, self.home, -1, self.links[receptacle], physicsClientId=self.client
        )
        # Index 7 is the normal on the home's body towards the object.
        return any(contact[7][2] > 0.7 for contact in contacts)


def _tilt_cosine(quaternion: Vector) -> float:
    x, y, _, _ = quaternion
    return 1 - 2 * (x * x + y * y)
