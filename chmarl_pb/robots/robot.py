"""What a robot in a world can do, whatever its kind."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Protocol

from chmarl_pb.navigation.lattice import AnyLattice
from chmarl_pb.robots.asked import planned
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.motion import Motion, Tick


class Robot(Protocol):
    """One robot in one world.

    :class:`chmarl_pb.robots.mobile.MobileRobot` and :class:`chmarl_pb.robots.manipulator.MobileManipulator` are made
    from robot files; a class of your own is given as ``make`` of a :class:`chmarl_pb.robots.model.RobotModel`.

    Attributes:
        name: of the agent.
        model: what is known of its kind.
        lattice: where it can be.
        actions: names of its actions, in the order of their numbers.
        neighbours: the other robots on its lattice, never in its cell; set once all robots are in the world.
    """

    name: str
    model: RobotModel
    lattice: AnyLattice
    actions: tuple[str, ...]
    neighbours: Sequence["Robot"]

    @property
    def pose(self) -> int:
        """Its pose on its lattice."""

    def spawn(self, pose: int) -> None:
        """Be at a pose, with what it holds."""

    def plan(
        self, action: str, goal: Goal | None = None, seen: Collection[str] = (), taken: Collection[int] = ()
    ) -> Motion | None:
        """Decide what an action does; nothing changes.

        Args:
            action: one of ``actions``.
            goal: what Pick and Place act on.
            seen: names of the things in its view.
            taken: cells of its lattice in which others stand: Goto takes the nearest free one, other moves fail.

        Returns:
            The motion, or None if the action fails.
        """

    def finish(self, motion: Motion) -> bool:
        """Set the result of a motion; return True if it succeeded; else False, and the world is as it was before."""

    def get_ready(self) -> None:
        """Prepare to be driven."""

    def drive(self, motion: Motion) -> Iterator[Tick | None]:
        """Drive through a motion in physics alone, one simulation step at a time; see ``execution="simulated"``.

        Yields:
            What the step is like; None: moved by motors, and nothing is in the way.
        """


def decide(
    robots: Mapping[str, Robot],
    actions: Mapping[str, str],
    goals: Mapping[str, Goal],
    seen: Mapping[str, Sequence[str]],
) -> dict[str, Motion | None]:
    """Let robots decide their motions one after the other; nothing changes.

    Two robots on one lattice never stand in one cell. An earlier robot's end counts as taken for the later ones, and so
    does where a later one stands for the earlier ones.

    Args:
        robots: all robots.
        actions: robot -> name of its action.
        goals: robot -> what its Pick and Place act on.
        seen: robot -> names of the things in its view.
    """
    motions: dict[str, Motion | None] = {}
    for name, robot in robots.items():
        motions[name] = planned(robot, actions[name], goals.get(name), seen[name], taken_cells(robot, motions))
    return motions


def taken_cells(robot: Robot, motions: Mapping[str, Motion | None] = {}) -> tuple[int, ...]:
    """Return the cells of a robot's lattice in which others stand, or will when they have carried out their motions."""
    if not robot.neighbours:
        return ()
    cell = robot.lattice.cell
    return tuple(
        cell(motion.pose if (motion := motions.get(other.name)) else other.pose) for other in robot.neighbours
    )  # fmt: skip


def introduce(robots: Mapping[str, Robot]) -> None:
    """Let robots know who shares their lattice."""
    for robot in robots.values():
        robot.neighbours = [
            other for other in robots.values() if other is not robot and other.lattice is robot.lattice
        ]  # fmt: skip
