"""The world: one PyBullet client with one home, its movable objects and their physics.

Only the object that is being put down is dynamic; all others are frozen (mass 0) where they stand.
So nothing drifts, a settle touches one body, and its result is the same after any history.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chmarl_pb import catalog
from chmarl_pb.homes.home import Home
from chmarl_pb.navigation.free_space import Size, grip_point
from chmarl_pb.world.bodies import (
    UPRIGHT,
    Pose,
    Vector,
    link_names,
    load_graspable,
    loaded_home,
    yaw_quaternion,
)
from chmarl_pb.world.bullet import pybullet
from chmarl_pb.world.client import Client, Uncopied
from chmarl_pb.world.touch import touching

TIME_STEP = 1 / 240  # seconds
_DROP = 0.004  # metres above a surface from which an object is let go
_STILL = 1e-2  # m/s and rad/s below which an object counts as at rest; contacts may leave it a jitter of 6e-3
_LONGEST_SETTLE = 240  # simulation steps
_UPRIGHT = np.cos(np.radians(15))


@dataclass(frozen=True)
class Support:
    """What carries an object.

    Attributes:
        receptacle: name of the thing of the home.
        height: z of the surface, metres.
    """

    receptacle: str
    height: float


class World(Uncopied):
    """One physics client with one home, all graspable objects and the robots.

    Attributes:
        home: the home.
        bodies: name -> body id of the home, the robots and the objects present.
        robots: name -> robot, filled by :meth:`add_robot`.
        held: name of the object in the gripper, or None.
        supports: object -> what carries it; the held object is not in it.
        links: name of a thing of the home -> PyBullet link index.
        version: grows with every change of ``objects``, ``pose``, ``supports`` or ``held``; an equal one means
            equal answers.
        layout: equal for equal answers, too, in all worlds of a home; None once something has changed since it was set.
        steps: steps of physics so far.
    """

    def __init__(self, home: Home):
        """Load a home and one object of every graspable class.

        Raises:
            HomeError: PyBullet cannot load the home.
            AssetError: the URDF of an object cannot be used.
        """
        self.home = home
        self._client = Client()
        self.move_body = self._client.move
        pybullet.setGravity(0, 0, -9.81, physicsClientId=self.physics)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=TIME_STEP, deterministicOverlappingPairs=1, physicsClientId=self.physics
        )
        self.robots: dict[str, Any] = {}
        self.held: str | None = None
        self._constraint: int | None = None
        self.supports: dict[str, Support] = {}
        self._poses: dict[str, Pose] = {}
        self.version, self.steps = 0, 0
        self.layout: object = None
        try:
            with loaded_home(self.physics, home) as body:
                self._home_body = body
            self.links = {name: number for number, name in enumerate(link_names(self.physics, self._home_body))}
            self._objects = {f"{name}_1": load_graspable(self.physics, name) for name in catalog.GRASPABLES}
        except BaseException:
            self.close()
            raise
        self.bodies: dict[str, int] = {"home": self._home_body}

    def close(self) -> None:
        """Disconnect the client; closing twice is allowed."""
        self._client.close()

    @property
    def client(self) -> int:
        """PyBullet client id. Once it has been asked for, every body is in it where it is in the world, at any time."""
        return self._client.shared

    @property
    def physics(self) -> int:
        """The same id for the package itself: all bodies are in their places now, but later moves may be put off."""
        return self._client.number

    def add_robot(self, name: str, robot: Any, body: int) -> None:
        """Register a robot and its body."""
        self.robots[name] = robot
        self.bodies[name] = body

    # Objects

    @property
    def objects(self) -> list[str]:
        """Names of the objects present, in the catalogue's order."""
        return [name for name in self._objects if name in self._poses]

    def size(self, name: str) -> Size:
        """Return an object's extents x, y, z in metres."""
        return self._objects[name].size

    def clear(self) -> None:
        """Take all objects out of the home."""
        self.release()
        for name in list(self._poses):
            self._park(name)

    def _park(self, name: str) -> None:
        self._move(name, self._objects[name].parking, UPRIGHT)
        self.supports.pop(name, None)
        del self._poses[name], self.bodies[name]

    def place(self, name: str, position: Vector, quaternion: Vector, receptacle: str | None = None) -> None:
        """Set an object's pose, without physics.

        Args:
            name: the object.
            position: of its bottom centre, metres.
            quaternion: its orientation (x, y, z, w).
            receptacle: name of what carries it there; None in the gripper.
        """
        self._move(name, position, quaternion)
        self.bodies[name] = self._objects[name].body
        self.supports.pop(name, None)
        if receptacle is not None:
            self.supports[name] = Support(receptacle, position[2])

    def _move(self, name: str, position: Vector, quaternion: Vector) -> None:
        self._poses[name] = (tuple(position), tuple(quaternion))
        self._change()
        thing = self._objects[name]
        self._client.move(thing.body, *self._poses[name], thing.inertial)

    def _change(self) -> None:
        self.version += 1
        self.layout = None

    def pose(self, name: str) -> Pose:
        """Return an object's bottom centre (metres) and its orientation (x, y, z, w)."""
        return self._poses[name]

    def grip(self, name: str) -> tuple[float, float, float]:
        """Return the point where an object that stands is gripped."""
        x, y, z = self._poses[name][0]
        return grip_point((x, y, z), self._objects[name].size)

    def read_pose(self, name: str) -> Pose:
        """Return an object's pose as physics has it now; :meth:`pose` is what was last set or settled."""
        thing = self._objects[name]
        centre, quaternion = pybullet.getBasePositionAndOrientation(thing.body, physicsClientId=self.physics)
        back = tuple(-value for value in thing.inertial)
        position, _ = pybullet.multiplyTransforms(centre, quaternion, back, UPRIGHT)
        return position, quaternion

    def taken(self, places: NDArray[np.floating], size: Size, ignoring: str | None = None) -> NDArray[np.bool_]:
        """Return at which places an object of this size would touch another object.

        Args:
            places: (n, 4) x, y, z and yaw of its bottom centre.
            size: extents along its own axes, metres.
            ignoring: name of the object itself.
        """
        skipped = (ignoring, self.held)
        others = [(pose, self._objects[name].size) for name, pose in self._poses.items() if name not in skipped]
        return touching(places, size, others)

    # Holding

    def attach(self, name: str, body: int, link: int, grasp: Pose) -> None:
        """Hold an object: a fixed constraint between a robot's link and the object.

        Args:
            name: the object.
            body: the robot's body id.
            link: the robot's link index.
            grasp: pose of the grasp frame in the world now.
        """
        self.release()
        self.held = name
        self._change()
        thing = self._objects[name]
        position, quaternion = self._poses[name]
        centre, _ = pybullet.multiplyTransforms(position, quaternion, thing.inertial, UPRIGHT)
        inverse = pybullet.invertTransform(centre, quaternion)
        pivot, turn = pybullet.multiplyTransforms(*inverse, *grasp)
        self._constraint = pybullet.createConstraint(
            body, link, thing.body, -1, pybullet.JOINT_FIXED, (0, 0, 0), (0, 0, 0), pivot, UPRIGHT, turn,
            physicsClientId=self.physics,
        )  # fmt: skip
        pybullet.changeConstraint(self._constraint, maxForce=200, physicsClientId=self.physics)

    def level(self, grasp: Pose, pose: Pose) -> None:
        """Turn the held object in the gripper towards a pose, when the gripper is at a grasp pose in the world."""
        assert self.held is not None and self._constraint is not None
        centre, turn = pybullet.multiplyTransforms(*pose, self._objects[self.held].inertial, UPRIGHT)
        pivot, orientation = pybullet.multiplyTransforms(*pybullet.invertTransform(centre, turn), *grasp)
        pybullet.changeConstraint(
            self._constraint,
            jointChildPivot=pivot,
            jointChildFrameOrientation=orientation,
            maxForce=200,
            physicsClientId=self.physics,
        )

    def release(self) -> None:
        """Open the gripper: remove the constraint."""
        if self._constraint is not None:
            pybullet.removeConstraint(self._constraint, physicsClientId=self.physics)
            self._change()
        self._constraint, self.held = None, None

    def thaw(self, name: str, solid: bool = True) -> None:
        """Make an object dynamic, at rest; one that is not solid passes through other things until frozen."""
        thing = self._objects[name]
        pybullet.changeDynamics(thing.body, -1, mass=thing.mass, physicsClientId=self.physics)
        # After changeDynamics, which sets PyBullet's default filter whenever it changes the mass.
        mask = -1 if solid else 0
        pybullet.setCollisionFilterGroupMask(thing.body, -1, int(solid), mask, physicsClientId=self.physics)
        pybullet.resetBaseVelocity(thing.body, (0, 0, 0), (0, 0, 0), physicsClientId=self.physics)

    def freeze(self, name: str) -> None:
        """Make an object immovable where it is."""
        body = self._objects[name].body
        pybullet.resetBaseVelocity(body, (0, 0, 0), (0, 0, 0), physicsClientId=self.physics)
        pybullet.changeDynamics(body, -1, mass=0, physicsClientId=self.physics)

    # Physics

    def step(self) -> None:
        """Advance physics by ``TIME_STEP``."""
        self.steps += 1
        pybullet.stepSimulation(physicsClientId=self.physics)

    def set_down(self, name: str, position: Vector, yaw: float, receptacle: str) -> bool:
        """Let an object go just above a place and let physics settle it.

        Returns:
            Whether it came to rest upright and the receptacle carries it, by contact. If not, the
            object is where it was before.
        """
        before = self._poses[name]
        x, y, z = position
        self._move(name, (x, y, z + _DROP), yaw_quaternion(yaw))
        self.thaw(name)
        still = self._settle(name)
        settled = self.read_pose(name)
        carried = still and _tilt_cosine(settled[1]) > _UPRIGHT and self.rests_on(name, receptacle)
        self.freeze(name)
        self._move(name, *(settled if carried else before))
        if carried:
            self.supports[name] = Support(receptacle, z)
        return carried

    def _settle(self, name: str) -> bool:
        body, quiet_steps = self._objects[name].body, 0
        for _ in range(_LONGEST_SETTLE):
            self.step()
            velocity = np.abs(pybullet.getBaseVelocity(body, physicsClientId=self.physics)).max()
            quiet_steps = quiet_steps + 1 if velocity < _STILL else 0
            if quiet_steps == 5:
                return True
        return False

    def rests_on(self, name: str, receptacle: str) -> bool:
        """Return whether a thing of the home carries an object: a contact that pushes it upwards."""
        contacts = pybullet.getContactPoints(
            self._objects[name].body, self._home_body, -1, self.links[receptacle], physicsClientId=self.physics
        )
        # Index 7 is the normal on the home's body towards the object.
        return any(contact[7][2] > 0.7 for contact in contacts)


def _tilt_cosine(quaternion: Vector) -> float:
    x, y, _, _ = quaternion
    return 1 - 2 * (x * x + y * y)
