"""What a robot decides, does and drives, asked of it; what a class of the user's own answers is checked.

So a mistake is told where it is made. The robots of this package are asked directly.
"""

from collections.abc import Collection, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from chmarl_pb.errors import OptionError
from chmarl_pb.fingerprint import name_of
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.motion import Motion, Tick

if TYPE_CHECKING:
    from chmarl_pb.robots.robot import Robot

_LONGEST = 200  # characters of a value in a message
_PACKAGE = f"{__name__.partition('.')[0]}."


def planned(
    robot: "Robot", action: str, goal: Goal | None = None, seen: Collection[str] = (), taken: Collection[int] = ()
) -> Motion | None:
    """Return what a robot decides that an action does, see :meth:`Robot.plan`.

    Raises:
        OptionError: a class of the user's own gives something else, or a pose that is none of its lattice.
    """
    motion = robot.plan(action, goal, seen, taken)
    return motion if motion is None or not _is_own(robot) else _checked(robot, action, motion)


def finished(robot: "Robot", motion: Motion) -> bool:
    """Let a robot set the result of a motion; return whether it succeeded, see :meth:`Robot.finish`.

    Raises:
        OptionError: a class of the user's own says something else, or is then at no pose of its lattice.
    """
    done: Any = robot.finish(motion)
    if not _is_own(robot):
        return bool(done)
    if not isinstance(done, bool | np.bool_ | int) or done not in (0, 1):
        raise _wrong(robot, f"finish({motion})", done, "True or False: whether the motion succeeded")
    if not _is_pose(robot, robot.pose):
        raise _wrong(robot, f"pose after finish({motion})", robot.pose, _poses(robot))
    return bool(done)


def driven(robot: "Robot", motion: Motion) -> Iterator[Tick | None]:
    """Drive a robot through a motion in physics alone, see :meth:`Robot.drive`.

    Raises:
        OptionError: a class of the user's own gives something else.
    """
    return _ticks(robot, motion) if _is_own(robot) else robot.drive(motion)


def _is_own(robot: "Robot") -> bool:
    """Return whether a robot's class is of the user's own."""
    return not type(robot).__module__.startswith(_PACKAGE)


def _checked(robot: "Robot", action: str, motion: Any) -> Motion:
    if not isinstance(motion, Motion) or not _is_pose(robot, motion.pose):
        wanted = f"None where the action fails, or a Motion whose pose is {_poses(robot)}"
        raise _wrong(robot, f"plan({action!r})", motion, wanted)
    return motion if type(motion.pose) is int else motion._replace(pose=int(motion.pose))  # not NumPy's, in states


def _ticks(robot: "Robot", motion: Motion) -> Iterator[Tick | None]:
    ticks: Any = robot.drive(motion)
    if not isinstance(ticks, Iterator):
        raise _wrong(robot, f"drive({motion})", ticks, "an iterator of Ticks, see MobileRobot.drive")
    for tick in ticks:
        if not isinstance(tick, Tick | None):
            raise _wrong(robot, f"drive({motion})", tick, "a Tick, or None, for each step")
        yield tick


def _is_pose(robot: "Robot", pose: Any) -> bool:
    whole = isinstance(pose, int | np.integer) and not isinstance(pose, bool)
    return whole and 0 <= pose < robot.lattice.count


def _poses(robot: "Robot") -> str:
    return f"a whole number from 0 to {robot.lattice.count - 1}, as its lattice has these poses"


def _wrong(robot: "Robot", what: str, given: Any, wanted: str) -> OptionError:
    shown = repr(given)
    shown = shown if len(shown) <= _LONGEST else f"{shown[:_LONGEST]}..."
    return OptionError(f"{name_of(type(robot))}.{what} is {shown}; it is to be {wanted}")
