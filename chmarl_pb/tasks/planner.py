"""The planner: privileged, knows where everything is, and takes the least number of joint steps.

Pick and Place drive by themselves, and the pose after a Pick depends on the object alone. So an
optimal plan is a shortest way to a pose from which X is seen, Pick, a shortest way to a pose from
which a Y with a free place is seen, Place. Both ways are found by breadth-first search over the
lattice; whether a pose sees a thing is answered by the camera itself. The drone never shortens a
plan: only the humanoid's view counts for Pick and Place. What it does meanwhile is planned in
:mod:`chmarl_pb.policies.cooperative_planner`.
"""

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from chmarl_pb.errors import TaskError
from chmarl_pb.rendering.renderer import Renderer
from chmarl_pb.robots.drone import Drone
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.humanoid import Humanoid
from chmarl_pb.tasks.targets import target_of
from chmarl_pb.tasks.view_bounds import Outlook

Seer = Callable[[NDArray[np.int64]], NDArray[np.bool_]]


class Oracle:
    """Plans for one world, from whatever state it is in."""

    def __init__(self, humanoid: Humanoid, drone: Drone, renderer: Renderer):
        """Plan for these robots of a world, looking with their eyes."""
        self.world, self.space, self.renderer = humanoid.world, humanoid.space, renderer
        self.outlook = Outlook(self.space)
        self.humanoid, self.drone = humanoid, drone

    def plan(self, goal: Goal, goals: Sequence[Goal] = ()) -> list[str]:
        """Return the humanoid's shortest list of actions that reach a goal from the present state.

        Args:
            goal: the goal.
            goals: all goals of the task, of which Pick takes the nearest object; this one alone if empty.

        Raises:
            TaskError: the object cannot be picked, or cannot be placed on any target.
        """
        if self.world.held == goal.item:
            return self._to_place(goal, self.humanoid.pose)
        support = self.world.supports[goal.item]
        if support.receptacle in goal.receptacles:
            return []
        motion_end = self.space.stand(self.world.grip(goal.item))
        if motion_end is None:
            raise TaskError(f"{goal.item} on {support.receptacle} cannot be reached; choose another place or seed")
        to_pick = self._search(
            self.humanoid.pose, self._sees_item(goal, goals or (goal,)), f"{goal.item} on {support.receptacle}"
        )
        with self._holding(goal.item, motion_end):
            return [*to_pick, "pick", *self._to_place(goal, motion_end)]

    def seen_from(self, robot: str, pose: int) -> tuple[str, ...]:
        """Return the names of the things that a robot would see at another pose."""
        before = self.world.state
        (self.humanoid if robot == self.humanoid.name else self.drone).spawn(pose)
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

    def _to_place(self, goal: Goal, start: int) -> list[str]:
        """Return the actions from a pose with the object in hand up to Place."""
        if self.humanoid.plan("place", goal, goal.receptacles) is None:
            raise TaskError(f"{goal.item} has no free place within reach on {' or '.join(goal.receptacles)}")
        return [*self._search(start, self._sees_target(goal), " or ".join(goal.receptacles)), "place"]

    def _search(self, start: int, sees: Seer, what: str) -> list[str]:
        names = self.humanoid.actions
        moving = [name for name in names if name not in ("pick", "place", "stay")]
        found = breadth_first(start, self.space.lattice.moves, sees)
        if found is None:
            raise TaskError(f"{self.space.home.name}: the humanoid cannot see {what} from any pose")
        return [moving[number] for number in found]

    def _sees_item(self, goal: Goal, goals: Sequence[Goal]) -> Seer:
        def works() -> bool:
            seen = self.renderer.visible("humanoid")
            meant = target_of(goals, self.world.state, "humanoid", seen) == goal
            return meant and self.humanoid.plan("pick", goal, seen) is not None

        return self._seer([(self.centre(goal.item), self.radius(goal.item))], works)

    def _sees_target(self, goal: Goal) -> Seer:
        balls = [(self.centre(name), self.radius(name)) for name in goal.receptacles]
        return self._seer(balls, lambda: self._works("place", goal))

    def _works(self, action: str, goal: Goal) -> bool:
        """Return whether an action of the humanoid works where it stands now."""
        return self.humanoid.plan(action, goal, self.renderer.visible(self.humanoid.name)) is not None

    def _seer(self, balls: list[tuple[NDArray[np.float64], float]], works: Callable[[], bool]) -> Seer:
        """Return a test of poses: the action works when the humanoid stands there."""

        def sees(poses: NDArray[np.int64]) -> NDArray[np.bool_]:
            maybe = np.logical_or.reduce([self.outlook.may_see(poses, centre, radius) for centre, radius in balls])
            found = np.zeros(len(poses), dtype=bool)
            for number in np.flatnonzero(maybe):
                with self._standing(int(poses[number])):
                    found[number] = works()
                if found[number]:
                    break  # breadth_first takes the first
            return found

        return sees

    @contextmanager
    def acting(self, actions: Sequence[str], goal: Goal) -> Iterator[None]:
        """Let the humanoid carry out actions for a goal, with physics, for a while.

        Raises:
            TaskError: one of them fails.
        """
        before = self.world.state
        try:
            for action in actions:
                motion = self.humanoid.plan(action, goal, self.renderer.visible("humanoid"))
                if motion is None or not self.humanoid.finish(motion):
                    raise TaskError(f"{goal.item}: {action} fails on the planned way; choose another place or seed")
            yield
        finally:
            self.world.state = before

    @contextmanager
    def _standing(self, pose: int) -> Iterator[None]:
        """Let the humanoid stand at a pose for a while."""
        before = self.world.state
        self.humanoid.spawn(pose)
        try:
            yield
        finally:
            self.world.state = before

    @contextmanager
    def _holding(self, item: str, stand: int) -> Iterator[None]:
        """Let the humanoid hold an object as after a Pick for a while."""
        with self._standing(stand):
            self.humanoid.hold(item, self.humanoid.turn_of(item, stand))
            yield

    def _box(self, name: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        solids = self.space.home.receptacles[name].solids
        low = np.min([[*solid.low, solid.bottom] for solid in solids], axis=0)
        high = np.max([[*solid.high, solid.top] for solid in solids], axis=0)
        return low, high


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
