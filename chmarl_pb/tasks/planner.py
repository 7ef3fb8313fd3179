"""The planner: privileged, knows where everything is, and takes the least number of joint steps.

Pick and Place drive by themselves, and the pose after a Pick depends on the object alone. So an
optimal plan is a shortest way to a pose from which X is seen, Pick, a shortest way to a pose from
which a Y with a free place is seen, Place. Both ways are found by breadth-first search over the
lattice; whether a pose sees a thing is answered by the camera itself. No other robot ever shortens a
plan: only the own view of a robot that can grasp counts. What the others do meanwhile is planned in
:mod:`chmarl_pb.policies.cooperative_planner`.

Where Pick and Place point, a pose will do only if X, or a Y, has most pixels in some cell. The plan is then the
shortest of those that touch X alone; see :attr:`Oracle.surely_shortest`.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.compiled import compiled
from chmarl_pb.errors import TaskError
from chmarl_pb.homes.solids import bounds
from chmarl_pb.navigation.lattice import AnyLattice
from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.robots.asked import finished, planned
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.pointing import verb_of
from chmarl_pb.robots.robot import Robot, taken_cells
from chmarl_pb.tasks.pointing import Pointer
from chmarl_pb.tasks.targets import target_of
from chmarl_pb.tasks.view_bounds import Outlook

Seer = Callable[[NDArray[np.int64]], NDArray[np.bool_]]
_LEAST_ASTRAY = 4  # steps of a plan that also touches something else, or puts X down on the way
_MOST_LOOKS = 2000  # views that a search draws before it gives up; the benchmark's tasks draw up to about 100
Cells = tuple[int, ...]  # of a lattice, in which other robots stand


class HiddenError(TaskError):
    """A search has drawn as many views as it may: what is looked for is hidden by what is not solid."""


class Oracle:
    """Plans for one robot that can grasp, from whatever state its world is in."""

    def __init__(
        self, robot: MobileManipulator, robots: Mapping[str, Robot], renderer: Renderer, pointer: Pointer | None = None
    ):
        """Plan for a robot.

        Args:
            robot: picks and places.
            robots: all robots of its world.
            renderer: tells what they see.
            pointer: tells what Pick and Place point at; None where they take no argument.
        """
        self.world, self.space, self.renderer, self.pointer = robot.world, robot.space, renderer, pointer
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
        if robot.held is not None and self.pointer is not None:
            return self._put_away(robot.held, goal, goals, alone)
        if goal.item not in self.world.supports:
            raise TaskError(f"another robot holds {goal.item}")
        support = self.world.supports[goal.item]
        if support.receptacle in goal.receptacles:
            return []
        motion_end = robot.stand(goal.item, taken)
        if motion_end is None:
            raise TaskError(f"{goal.item} on {support.receptacle} cannot be reached; choose another place or seed")
        to_pick = self._to_pick(goal, goals or (goal,), f"{goal.item} on {support.receptacle}", taken)
        with self._holding(goal.item, motion_end):
            return [*to_pick, *self._to_place(goal, motion_end, taken)]

    def surely_shortest(self, plan: Sequence[str]) -> bool:
        """Return whether no plan that also touches something else than X can be shorter, if no other robot can help.

        Without pointing there is none. With it, Pick and Place of whatever is in view also drive the robot there, which
        now and then may save steps; such plans have four steps or more.
        """
        return self.pointer is None or len(plan) <= _LEAST_ASTRAY

    def useful(self, goal: Goal, goals: Sequence[Goal] = (), taken: Cells = ()) -> Iterator[str]:
        """Yield the Picks, or Places, that would now bring a goal nearer; of several the one with most pixels first.

        Args:
            goal: the goal.
            goals: all goals of the task; this one alone if empty.
            taken: cells in which other robots stand.
        """
        robot, seen = self.robot, self.renderer.visible(self.robot.name)
        if robot.held == goal.item:
            in_view = [name for name in goal.receptacles if name in seen]
            for action, things in self._acting_on("place", in_view):
                if planned(robot, "place", Goal(goal.item, tuple(things)), seen, taken) is not None:
                    yield action
        elif robot.held is None:
            meant = self.pointer is not None or target_of(goals or (goal,), self.world.state, robot.name, seen) == goal
            if meant and planned(robot, "pick", goal, seen, taken) is not None:
                yield from (action for action, _ in self._acting_on("pick", (goal.item,)))

    def _acting_on(self, verb: str, things: Collection[str]) -> Iterable[tuple[str, Collection[str]]]:
        """Return the Picks, or Places, that act on one of some things, and on which of them each does."""
        if self.pointer is None or not things:
            return [(verb, things)] if things else []
        shown = self.pointer.shown(self.robot.name, verb)
        return [(action, (thing,)) for action, thing in shown.items() if thing in things]

    def seen_from(self, robot: str, pose: int) -> tuple[str, ...]:
        """Return the names of the things that a robot would see at another pose."""
        before = self.world.state
        self.robots[robot].spawn(pose)
        try:
            return self.renderer.visible(robot)
        finally:
            self.world.state = before

    def ball(self, name: str) -> NDArray[np.float64]:
        """Return x, y, z and radius, metres, of a ball that holds an object present or a receptacle."""
        if name in self.world.state.objects.poses:
            (x, y, z), size = self.world.pose(name)[0], self.world.size(name)
            return np.array([x, y, z + size[2] / 2, np.linalg.norm(size) / 2 + 0.05])
        low, high = bounds(self.space.home.receptacles[name].solids)
        return np.array([*(low + high) / 2, np.linalg.norm(high - low) / 2 + 0.1])  # what is drawn may jut out a little

    def _to_place(self, goal: Goal, start: int, taken: Cells) -> list[str]:
        """Return the actions from a pose with the object in hand up to Place."""
        if planned(self.robot, "place", goal, goal.receptacles, taken) is None:
            raise TaskError(f"{goal.item} has no free place within reach on {' or '.join(goal.receptacles)}")
        balls = np.stack([self.ball(name) for name in goal.receptacles])
        works = partial(self.useful, goal, taken=taken)
        return self._search(start, " or ".join(goal.receptacles), balls, lambda: True, works, taken)

    def _to_pick(self, goal: Goal, goals: Sequence[Goal], what: str, taken: Cells) -> list[str]:
        """Return the actions with an empty hand up to Pick."""
        could = partial(self.renderer.could_see, self.robot.name, goal.item)
        works = partial(self.useful, goal, goals, taken)
        return self._search(self.robot.pose, what, self.ball(goal.item)[None], could, works, taken)

    def _put_away(self, held: str, goal: Goal, goals: Sequence[Goal], alone: bool) -> list[str]:
        """Return the actions that put down what no goal asks for, as soon as possible, and then reach a goal."""
        anywhere = Goal(held, tuple(self.space.home.receptacles))
        away = self._to_place(anywhere, self.robot.pose, () if alone else taken_cells(self.robot))
        try:
            with self.acting(away, anywhere):
                return [*away, *self.plan(goal, goals, alone)]
        finally:
            self.world.sync()

    def _search(
        self, start: int, what: str, balls: NDArray[np.float64], could: Callable[[], bool],
        works: Callable[[], Iterator[str]], taken: Cells,
    ) -> list[str]:  # fmt: skip
        """Return the shortest way to a pose where a Pick, or a Place, works, and that at its end.

        Args:
            start: the pose to start from.
            what: is to be seen.
            balls: (m, 4) centres and radii of balls in one of which it lies.
            could: whether it can be seen if nothing hides it, when the robot stands there.
            works: yields the Picks, or Places, that work then; it may draw a view of the home.
            taken: cells in which other robots stand.
        """
        looks, action = 0, ""

        def sees(poses: NDArray[np.int64]) -> NDArray[np.bool_]:
            nonlocal looks, action
            found = np.zeros(len(poses), dtype=bool)
            for number in np.flatnonzero(self.outlook.may_see(poses, balls)):
                with self._standing(int(poses[number])):
                    if not could():
                        continue
                    action = next(works(), "")
                if action:
                    found[number] = True
                    break  # breadth_first takes the first
                looks += 1
                if looks == _MOST_LOOKS:
                    raise HiddenError(f"{what} is not seen from {looks:,} poses on the way; take away what hides it")
            return found

        moves = breadth_first(start, free_moves(self.robot.lattice, taken), sees)
        if moves is None:
            raise TaskError(f"{self.space.home.name}: the {self.robot.name} cannot see {what} from any pose")
        moving = [name for name in self.robot.actions if name not in (*self.robot.arm_actions, "stay")]
        return [*(moving[number] for number in moves), action]

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
                meant = goal if self.pointer is None else self.pointer.meant(self.robot.name, action)
                motion = planned(self.robot, verb_of(action), meant, seen, taken)
                if motion is None or not finished(self.robot, motion):
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
        following = np.empty(len(moves), dtype=np.int64)
        frontier = following[: _expand(frontier, moves, parent, kind, following)]
    return None


@compiled
def _expand(frontier, moves, parent, kind, following):  # type: ignore[no-untyped-def]
    """Set the poses that are one move farther, ordered by the kind of move and then by number; return how many."""
    count = 0
    for number in range(moves.shape[1]):
        first = count
        for pose in frontier:
            end = moves[pose, number]
            if end >= 0 and parent[end] < 0:
                parent[end], kind[end], following[count] = pose, number, end
                count += 1
        following[first:count].sort()
    return count


def _path(pose: int, start: int, parent: NDArray[np.int64], kind: NDArray[np.int64]) -> list[int]:
    path = []
    while pose != start:
        path.append(int(kind[pose]))
        pose = int(parent[pose])
    return path[::-1]
