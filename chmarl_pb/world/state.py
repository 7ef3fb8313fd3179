"""The state of a world: plain values that are never changed, only replaced.

Whoever keeps something that follows from the state, or from one of its parts, compares by identity:
``world.state.objects is self._objects`` says that no object has moved since. A part that has not changed
is the same object in the next state.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

from chmarl_pb.world.bodies import Pose


@dataclass(frozen=True, slots=True)
class Support:
    """What carries an object.

    Attributes:
        receptacle: name of the furniture.
        height: z of the surface, metres.
    """

    receptacle: str
    height: float


@dataclass(frozen=True, slots=True)
class Grip:
    """What a gripper holds.

    Attributes:
        item: name of the object.
        turn: its yaw relative to the robot's base, radians.
    """

    item: str
    turn: float


@dataclass(frozen=True, slots=True)
class RobotState:
    """Where a robot is.

    Attributes:
        pose: number of its pose on its lattice.
        room: index of its room in ``list(home.rooms)``.
        heading: in steps of 30 degrees from +x.
        base: position (metres) and orientation (x, y, z, w) of its base.
        joints: positions of its movable joints (radians, metres); empty if it has none.
    """

    pose: int
    room: int
    heading: int
    base: Pose
    joints: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Objects:
    """Where the objects are.

    Attributes:
        poses: name of each object present -> its bottom centre (metres) and orientation (x, y, z, w).
        supports: object -> what carries it; one in a gripper is not in it.
    """

    poses: Mapping[str, Pose] = field(default_factory=dict)
    supports: Mapping[str, Support] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class WorldState:
    """Everything that changes in an episode.

    Attributes:
        objects: where the objects are.
        grips: name of a robot that holds something -> what it holds.
        robots: robot -> where it is.
    """

    objects: Objects = field(default_factory=Objects)
    grips: Mapping[str, Grip] = field(default_factory=dict)
    robots: Mapping[str, RobotState] = field(default_factory=dict)

    @property
    def held(self) -> tuple[str, ...]:
        """The objects in grippers."""
        return tuple([grip.item for grip in self.grips.values()])
