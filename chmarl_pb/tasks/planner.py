"""The planner: privileged, knows where everything is, and takes the least number of joint steps.

Pick and Place drive by themselves, and the pose after a Pick depends on the object alone. So an
optimal plan is a shortest way to a pose from which X is seen, Pick, a shortest way to a pose from
which a Y with a free place is seen, Place. Both ways are found by breadth-first search over the
lattice; whether a pose sees a thing is answered by the camera itself. No other robot ever shortens a
plan: only the own view of a robot that can grasp counts. What the others do meanwhile is planned in
:mod:`chmarl_pb.policies.cooperative_planner`.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.errors import TaskError
from chmarl_pb.navigation.lattice import AnyLattice
from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.robot import Robot, taken_cells
from chmarl_pb.tasks.targets import target_of
from chmarl_pb.tasks.view_bounds import Outlook

Seer = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
_MOST_LOOKS = 2000  # views that a search draws before it gives up; the benchmark's tasks draw up to about 100
Cells = tuple[int, ...]  # of a lattice, in which other robots stand


class HiddenError(TaskError):
    """A search has drawn as many views as it may: what is looked for is hidden by what is not solid."""


class Oracle:
    """Plans for one robot that can grasp, from whatever state its world is in."""

    def __init__(self, robot: MobileManipulator, robots: Mapping[str, Robot], renderer: Renderer):
        """Plan for a robot.

        Args:
            robot: picks and places.
            robots: all robots of its world.
            renderer: tells what they see.
        """
        self.world, self.space, self.renderer = robot.world, robot.space, renderer
        self.outlook = Outlook(self.space, robot.model)
        self.robot, self.robots = robot, robots

    def plan(self, goal: Goal, goals: Sequence[Goal] = (), alone: bool = False) -> list[str]:
        """Return the robot's shortest list of actions that reach a goal from the present state.

        Args:
            goal: the goal.
            goals: all goals of the task, of which Pick takes the nearest object; this one alone if empty.
            alone: let the other robots not be in the way; else they stay in their cells.

        Raises:
            TaskError: the object cannot be picked, or cannot be placed on any target.
        """
        robot, taken = self.robot, () if alone else taken_cells(self.robot)
        if robot.held == goal.item:
            return self._to_place(goal, robot.pose, taken)
        if goal.item not in self.world.supports:
            raise TaskError(f"another robot holds {goal.item}")
        support = self.world.supports[goal.item]
        if support.receptacle in goal.receptacles:
            return []
        motion_end = robot.stand(goal.item, taken)
        if motion_end is None:
            raise TaskError(f"{goal.item} on {support.receptacle} cannot be reached; choose another place or seed")
        what = f"{goal.item} on {support.receptacle}"
        to_pick = self._search(robot.pose, self._sees_item(goal, goals or (goal,), taken), what, taken)
        with self._holding(goal.item, motion_end):
            return [*to_pick, "pick", *self._to_place(goal, motion_end, taken)]

    def seen_from(self, robot: str, pose: int) -> tuple[str, ...]:
        """Return the names of the things that a robot would see at another pose."""
        before = self.world.state
        self.robots[robot].spawn(pose)
        try:
            return self.renderer.visible(robot)
        finally:
            self.world.state = before

    def centre(self, name: str) -> NDArray[np.float64]:
        """Return the middle (x, y, z) of an object present or of a receptacle, metres."""
        if name in self.world.state.objects.poses:
            x, y, z = self.world.pose(name)[0]
            return np.array([x, y, z + self.world.size(name)[2] / 2])
        low, high = self._box(name)
        return (low + high) / 2

    def radius(self, name: str) -> float:
        """Return the radius in metres of a ball about its centre that holds an object or a receptacle."""
        if name in self.world.state.objects.poses:
            return float(np.linalg.norm(self.world.size(name))) / 2 + 0.05
        low, high = self._box(name)
        return float(np.linalg.norm(high - low)) / 2 + 0.1  # what is drawn may jut out a little

    def _to_place(self, goal: Goal, start: int, taken: Cells) -> list[str]:
        """Return the actions from a pose with the object in hand up to Place."""
        if self.robot.plan("place", goal, goal.receptacles, taken) is None:
            raise TaskError(f"{goal.item} has no free place within reach on {' or '.join(goal.receptacles)}")
        sees = self._sees_target(goal, taken)
        return [*self._search(start, sees, " or ".join(goal.receptacles), taken), "place"]

    def _search(self, start: int, sees: Seer, what: str, taken: Cells) -> list[str]:
        moving = [name for name in self.robot.actions if name not in ("pick", "place", "stay")]
        found = breadth_first(start, free_moves(self.robot.lattice, taken), sees)
        if found is None:
            raise TaskError(f"{self.space.home.name}: the {self.robot.name} cannot see {what} from any pose")
        return [moving[number] for number in found]

    def _sees_item(self, goal: Goal, goals: Sequence[Goal], taken: Cells) -> Seer:
        robot = self.robot

        def works() -> bool:
            seen = self.renderer.visible(robot.name)
            meant = target_of(goals, self.world.state, robot.name, seen) == goal
            return meant and robot.plan("pick", goal, seen, taken) is not None

        ball = self.centre(goal.item), self.radius(goal.item)
        return self._seer(goal.item, [ball], lambda: self.renderer.could_see(robot.name, goal.item), works)

    def _sees_target(self, goal: Goal, taken: Cells) -> Seer:
        robot = self.robot
        balls = [(self.centre(name), self.radius(name)) for name in goal.receptacles]

        def works() -> bool:
            return robot.plan("place", goal, self.renderer.visible(robot.name), taken) is not None

        return self._seer(" or ".join(goal.receptacles), balls, lambda: True, works)

    def _seer(
        self, what: str, balls: list[tuple[NDArray[np.float64], float]], could: Callable[[], bool],
        works: Callable[[], bool],
    ) -> Seer:  # fmt: skip
        """Return a test of poses: the action works when the robot stands there.

        Args:
            what: is to be seen.
            balls: in which it lies, one of them.
            could: whether it can be seen if nothing hides it.
            works: the test itself, which may draw a view of the home.
        """
        looks = 0

        def sees(poses: NDArray[np.int64]) -> NDArray[np.bool_]:
            nonlocal looks
            maybe = np.logical_or.reduce([self.outlook.may_see(poses, centre, radius) for centre, radius in balls])
            found = np.zeros(len(poses), dtype=bool)
            for number in np.flatnonzero(maybe):
                with self._standing(int(poses[number])):
                    if not could():
                        continue
                    found[number] = works()
                if found[number]:
                    break  # breadth_first takes the first
                looks += 1
                if looks == _MOST_LOOKS:
                    raise HiddenError(f"{what} is not seen from {looks:,} poses on the way; take away what hides it")
            return found

        return sees

    @contextmanager
    def acting(self, actions: Sequence[str], goal: Goal) -> Iterator[None]:
        """Let the robot carry out actions for a goal, with physics, for a while.

        Raises:
            TaskError: one of them fails.
        """
        before = self.world.state
        try:
            for action in actions:
                seen, taken = self.renderer.visible(self.robot.name), taken_cells(self.robot)
                motion = self.robot.plan(action, goal, seen, taken)
                if motion is None or not self.robot.finish(motion):
                    raise TaskError(f"{goal.item}: {action} fails on the planned way; choose another place or seed")
            yield
        finally:
            self.world.state = before

    @contextmanager
    def _standing(self, pose: int) -> Iterator[None]:
        """Let the robot stand at a pose for a while."""
        before = self.world.state
        self.robot.spawn(pose)
        try:
            yield
        finally:
            self.world.state = before

    @contextmanager
    def _holding(self, item: str, stand: int) -> Iterator[None]:
        """Let the robot hold an object as after a Pick for a while."""
        with self._standing(stand):
            self.robot.hold(item, self.robot.turn_of(item, stand))
            yield

    def _box(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        solids = self.space.home.receptacles[name].solids
        low = np.min([[*solid.low, solid.bottom] for solid in solids], axis=0)
        high = np.max([[*solid.high, solid.top] for solid in solids], axis=0)
        return low, high


def free_moves(lattice: AnyLattice, taken: Cells) -> NDArray[np.int32]:
    """Return a lattice's moves where others stand: Goto takes the nearest free cell, other moves are blocked."""
    if not taken:
        return lattice.moves
    moves, gotos = lattice.moves.copy(), len(lattice.anchors)
    blocked = np.isin([lattice.cell(pose) for pose in range(lattice.count)], taken)
    moves[:, gotos:][blocked[moves[:, gotos:]] & (moves[:, gotos:] >= 0)] = -1
    for column, anchor in enumerate(lattice.anchors.values()):
        if lattice.cell(anchor) in taken:
            moves[:, column] = lattice.nearest(anchor, taken)
    return moves


def breadth_first(start: int, moves: NDArray[np.int32], sees: Seer) -> list[int] | None:
    """Return the fewest moves from a pose to one that passes a test, or None if there is none.

    Args:
        start: the pose to start from.
        moves: (poses, kinds) the pose after each kind of move, -1 where it is blocked.
        sees: test of many poses at once; of those that pass at the least depth the first is taken.
    """
    parent = np.full(len(moves), -1, dtype=np.int64)
    kind = np.full(len(moves), -1, dtype=np.int64)
    parent[start] = start
    frontier = np.array([start])
    while len(frontier):
        passed = np.flatnonzero(sees(frontier))
        if len(passed):
            return _path(int(frontier[passed[0]]), start, parent, kind)
        following = []
        for number in range(moves.shape[1]):
            ends = moves[frontier, number]
            reached, first = np.unique(ends, return_index=True)
            new = (reached >= 0) & (parent[reached] < 0)
            parent[reached[new]] = frontier[first[new]]
            kind[reached[new]] = number
            following.append(reached[new])
        frontier = np.concatenate(following).astype(np.int64)
    return None


def _path(pose: int, start: int, parent: NDArray[np.int64], kind: NDArray[np.int64]) -> list[int]:
    path = []
    while pose != start:
        path.append(int(kind[pose]))
        pose = int(parent[pose])
    return path[::-1]
