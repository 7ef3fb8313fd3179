"""What one action makes a robot do, decided before anything moves."""

from dataclasses import dataclass
from typing import NamedTuple

from chmarl_pb.world import Vector


class Motion(NamedTuple):  # a frozen dataclass takes twice as long, and every step makes some
    """A decided action: both executions carry out the same one.

    Attributes:
        pose: where the robot ends (a pose for the humanoid, a position for the drone).
        arm: configuration that reaches the grip or the place, for Pick and Place.
        pick: name of the object to pick.
        place: where to put the object that is held.
    """

    pose: int
    arm: tuple[float, ...] | None = None
    pick: str | None = None
    place: "Placement | None" = None


@dataclass(frozen=True)
class Placement:
    """Where to put an object: receptacle, bottom centre (metres) and yaw (radians)."""

    receptacle: str
    position: Vector
    yaw: float


@dataclass(frozen=True)
class Tick:
    """One simulation step of a driven motion.

    Attributes:
        depth: how deep an arm, or what it holds, stands in something before the step, metres; 0 if not measured.
        by_motors: whether motors move the robot, so that physics has to be simulated; if not, it is put where it is.
    """

    depth: float = 0.0
    by_motors: bool = True
