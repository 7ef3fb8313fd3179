"""Robots as data: what is known of one kind of robot, and what follows from it in a home."""

import math
import os
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.errors import AssetError
from chmarl_pb.navigation.free_space import Space
from chmarl_pb.navigation.lattice import FOOTPRINT, AnyLattice, Footprint
from chmarl_pb.navigation.reach import Reach
from chmarl_pb.robots.arm_model import ArmModel
from chmarl_pb.robots.plain_robot import plain_robot
from chmarl_pb.world import Pose, Vector, yaw_quaternion
from chmarl_pb.world.bullet import pybullet, quiet

FOV = 10.0, 150.0  # degrees
PITCH = -math.pi / 2, math.pi / 2  # radians
ALTITUDE = 2.0, 20.0  # metres, of one that flies
POSITION = -20.0, 20.0  # metres, of the lens
SPEED = 0.05, 10.0  # m/s
TURN_SPEED = math.radians(5.0), math.radians(720.0)  # rad/s


@dataclass(frozen=True)
class CameraMount:
    """A robot's camera and where it sits on the robot.

    Attributes:
        fov: opening angle, degrees.
        position: of the lens in the frame of the robot's base, metres; it rises with the first joint of the humanoid's
            arm.
        pitch: by which it looks down, radians.
    """

    fov: float
    position: tuple[float, float, float]
    pitch: float

    def eye(self, base: Pose, yaw: float, lift: float = 0.0) -> Pose:
        """Return the pose of the lens in the world; its +x looks along the line of sight.

        Args:
            base: pose of the robot's base.
            yaw: heading of the base, radians.
            lift: how far the camera is raised, metres.
        """
        (x, y, z), (forward, left, height) = base[0], self.position
        cosine, sine = float(np.cos(yaw)), float(np.sin(yaw))
        position = (x + forward * cosine - left * sine, y + forward * sine + left * cosine, z + height + lift)
        return position, looking(yaw, self.pitch)


@dataclass(frozen=True, eq=False)
class RobotModel:
    """One kind of robot.

    Attributes:
        name: of the kind; agents are named by it.
        urdf: its body.
        class_name: class of the catalogue that scene graphs call it.
        camera: its camera.
        flies: whether it flies over the walls, rather than drives between the furniture.
        footprint: the room that it takes if it drives.
        altitude: of its base above the floor, metres.
        speed: highest, m/s.
        turn_speed: highest, rad/s.
        reach: of its arm; None if it has none.
        arm: its arm, if that is not the humanoid's.
        make: makes the robot in a world, as :data:`chmarl_pb.robots.registry.Make`; None: by the facts above.

    Models are compared by identity. A copy of one that was read from a robot file is what that file gives.
    """

    name: str
    urdf: Path
    class_name: str
    camera: CameraMount
    flies: bool = False
    footprint: Footprint = FOOTPRINT
    altitude: float = 0.0
    speed: float = 1.2
    turn_speed: float = 2.2
    reach: Reach | None = None
    arm: ArmModel | None = None
    make: Callable[..., Any] | None = None
    copied_by: tuple[Callable[..., Any], tuple[Any, ...]] | None = field(default=None, init=False, repr=False)

    def __reduce_ex__(self, protocol: Any) -> Any:
        """Let copies be made as this one was."""
        return self.copied_by or super().__reduce_ex__(protocol)

    def __post_init__(self) -> None:
        """Refuse what robot files refuse, too.

        Raises:
            AssetError: agents cannot be named so, scene graphs know no such class, a number is out of its limits, or
                ``make`` makes nothing.
        """
        check_name(self.name)
        if not isinstance(self.urdf, str | os.PathLike):
            raise AssetError(f"robot {self.name!r}: urdf={self.urdf!r}; give the path of its URDF")
        object.__setattr__(self, "urdf", Path(self.urdf))
        if not isinstance(self.camera, CameraMount) or len(self.camera.position) != 3:
            raise AssetError(f"robot {self.name!r}: camera={self.camera!r}; give a CameraMount at (x, y, z)")
        known = tuple(BENCHMARK.robots)
        if self.class_name not in known:
            raise AssetError(f"robot {self.name!r}: class_name={self.class_name!r}; use one of: {', '.join(known)}")
        for name, value, (least, most) in (
            ("camera.fov", self.camera.fov, FOV),
            ("camera.pitch", self.camera.pitch, PITCH),
            *(("camera.position", metres, POSITION) for metres in self.camera.position),
            ("altitude", self.altitude, ALTITUDE if self.flies else (0.0, ALTITUDE[1])),
            ("speed", self.speed, SPEED),
            ("turn_speed", self.turn_speed, TURN_SPEED),
        ):
            if not isinstance(value, int | float | np.number) or not least <= value <= most:
                raise AssetError(f"robot {self.name!r}: {name}={value}; use a number from {least:g} to {most:g}")
        if self.make is not None and not callable(self.make):
            raise AssetError(f"robot {self.name!r}: make={self.make!r} is no function; name one that makes a robot")

    @property
    def lifts_camera(self) -> bool:
        """Whether its camera rises with its first joint."""
        return self.reach is not None and self.arm is None

    def lattice(self, space: Space) -> AnyLattice:
        """Return where it can be in a home.

        Raises:
            HomeError: it cannot reach a room.
        """
        return space.drone_lattice if self.flies else space.lattice_of(self.footprint)

    def base(self, space: Space, pose: int) -> Pose:
        """Return where its base is at a pose of its lattice."""
        x, y, yaw = self.lattice(space).pose(pose)
        return (x, y, self.altitude), yaw_quaternion(yaw)

    def eye(self, space: Space, pose: int) -> Pose:
        """Return where its camera is at a pose of its lattice."""
        return self.camera.eye(self.base(space, pose), self.lattice(space).pose(pose)[2])

    def load(self, client: int) -> int:
        """Load its body into a client; the lattice keeps it clear of the home, so it collides with nothing.

        Raises:
            AssetError: a file of it cannot be used, or PyBullet cannot load it.
        """
        flags, urdf = pybullet.URDF_USE_INERTIA_FROM_FILE, plain_robot(self.urdf)
        try:
            with quiet():
                body = int(pybullet.loadURDF(str(urdf), useFixedBase=True, flags=flags, physicsClientId=client))
        except pybullet.error as error:
            raise AssetError(f"{self.urdf}: PyBullet cannot load this robot ({error}); make it simpler") from error
        for link in range(-1, pybullet.getNumJoints(body, physicsClientId=client)):
            pybullet.setCollisionFilterGroupMask(body, link, 0, 0, physicsClientId=client)
        return body


def check_name(name: str) -> None:
    """Check the name of a kind of robots, by which agents are called, with numbers after it where it repeats.

    Raises:
        AssetError: it cannot be one.
    """
    if not isinstance(name, str) or not name.isidentifier() or name[-1].isdigit():
        raise AssetError(f"robot {name!r}: agents get this name; let it be letters and _, with no digit at its end")


def looking(yaw: float, pitch: float) -> Vector:
    """Return the orientation (x, y, z, w) of a camera turned by a yaw and then down by a pitch, radians."""
    cy, sy, cp, sp = np.cos(yaw / 2), np.sin(yaw / 2), np.cos(pitch / 2), np.sin(pitch / 2)
    return float(-sy * sp), float(cy * sp), float(sy * cp), float(cy * cp)
