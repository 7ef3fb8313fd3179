"""A simulation: one home with its world, its robots and what draws their views, kept for all episodes played in it."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import islice
from typing import NamedTuple, TypeGuard

from chmarl_pb.catalog import BENCHMARK, Catalog
from chmarl_pb.errors import HomeError, TaskError
from chmarl_pb.garbage import uncollected
from chmarl_pb.homes.home import load_home
from chmarl_pb.homes.lookalikes import among_lookalikes
from chmarl_pb.navigation.check import limits
from chmarl_pb.navigation.free_space import space_of
from chmarl_pb.rendering.registry import RENDERERS
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.manipulator import MobileManipulator
from chmarl_pb.robots.model import RobotModel
from chmarl_pb.robots.pointing import pointing_actions
from chmarl_pb.robots.registry import TEAM, make_robot, team_of
from chmarl_pb.robots.robot import Robot, introduce
from chmarl_pb.sensing.scene_graph import SceneGraphs
from chmarl_pb.tasks.kinds import REARRANGE, TaskKind
from chmarl_pb.tasks.lookalike_task import LookalikeTask, draw_lookalikes
from chmarl_pb.tasks.order import TeamPlan, plan_team
from chmarl_pb.tasks.planner import Oracle
from chmarl_pb.tasks.pointing import Pointer
from chmarl_pb.tasks.setting import Setting, draw_starts
from chmarl_pb.tasks.splits import check_fixed
from chmarl_pb.tasks.targets import target_of
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import AnyTask
from chmarl_pb.world import Uncopied, World

_DRAWS = 100  # of lookalikes for a task until the planner solves it
_KEPT = 2048  # tasks whose lookalikes are kept


class _Definite(NamedTuple):
    """What a task has become among lookalikes.

    Attributes:
        task: with all that its instruction names.
        plan: the one that proved that it can be solved; None where no robot grasps.
        kind: that it was planned for.
    """

    task: LookalikeTask
    plan: TeamPlan | None
    kind: TaskKind


class Simulation(Uncopied):
    """One home, ready to play.

    Attributes:
        space: what the home offers.
        world: the physics.
        models: robot -> what is known of its kind.
        robots: name -> robot.
        renderer: draws what they see.
        graphs: the scene graphs of what they see.
        pointer: tells what Pick and Place point at; None where they take no argument.
        oracles: robot that can grasp -> the privileged planner of what it does.
    """

    def __init__(
        self,
        home: str,
        models: Mapping[str, RobotModel] | None = None,
        renderer: str = "fast",
        known: Catalog = BENCHMARK,
        pointing: bool = False,
        lookalikes: bool = False,
    ):
        """Load a home.

        Args:
            home: its name or path.
            models: robot -> its kind; the benchmark's robots if None.
            renderer: one of :data:`chmarl_pb.rendering.registry.RENDERERS`.
            known: the classes of things.
            pointing: whether Pick and Place name a cell, see :mod:`chmarl_pb.tasks.pointing`.
            lookalikes: whether there are other objects of X's class, see :mod:`chmarl_pb.tasks.lookalike_task`.

        Raises:
            HomeError: the home cannot be used.
            AssetError: a robot cannot be loaded.
        """
        self.home, self.models = load_home(home, known), team_of(TEAM) if models is None else models
        check_fixed(home, self.home)
        if lookalikes:
            self.home = among_lookalikes(self.home)
        self._lookalikes = lookalikes
        self._definite: dict[Task, _Definite] = {}  # of tasks without their length, which is known later
        for problem in limits(self.home, len(self.models)):
            raise HomeError(f"{self.home.path}: {problem}")
        self.space = space_of(self.home)
        # Derive lattice and surfaces first: a home that robots cannot move in is refused before physics loads it.
        self.rooms, _ = tuple(self.space.lattice.anchors), self.space.surfaces
        self.room_names = tuple(self.home.rooms)
        # Where each room of the home stands in ``rooms``; after the last if it is none of them.
        self.room_numbers = [
            self.rooms.index(room) if room in self.rooms else len(self.rooms) for room in self.home.rooms
        ]
        self.world = World(self.home)
        try:
            self.robots: dict[str, Robot] = {
                name: make_robot(model, self.world, self.space, name) for name, model in self.models.items()
            }
            introduce(self.robots)
            self._lattices = tuple(robot.lattice for robot in self.robots.values())
            self.renderer = RENDERERS[renderer](self.world, self.models)
            self.graphs = SceneGraphs(self.space, self.world.links, self.renderer.names, self.models)
            self.pointer = Pointer(self.world, self.renderer) if pointing else None
            self.oracles = {
                name: Oracle(robot, self.robots, self.renderer, self.pointer)
                for name, robot in self.robots.items()
                if isinstance(robot, MobileManipulator)
            }
        except BaseException:
            self.close()
            raise

    @property
    def actions(self) -> dict[str, tuple[str, ...]]:
        """Robot -> names of its actions, in the order of their numbers."""
        names = {name: robot.actions for name, robot in self.robots.items()}
        return names if self.pointer is None else {name: pointing_actions(own) for name, own in names.items()}

    def targets(
        self, actions: Mapping[str, str], goals: Sequence[Goal], seen: Mapping[str, Sequence[str]]
    ) -> dict[str, Goal]:
        """Return robot -> what its Pick or Place acts on: what it points at, else what the task is about."""
        state, graspers = self.world.state, self.world.graspers
        if self.pointer is None:
            return {name: target_of(goals, state, name, seen[name]) for name in graspers}
        meant = {name: self.pointer.meant(name, actions[name]) for name in graspers}
        return {name: goal for name, goal in meant.items() if goal is not None}

    def definite(self, task: AnyTask, kind: TaskKind = REARRANGE) -> AnyTask:
        """Return a task with all that its instruction names; among lookalikes it is drawn until the planner solves it.

        Raises:
            TaskError: the home cannot hold the task, or the planner does not solve any that it may become.
        """
        return self._become(task, kind).task if self._is_indefinite(task) else task

    def _is_indefinite(self, task: AnyTask) -> TypeGuard[Task]:
        """Return whether lookalikes are still to be drawn for a task."""
        return self._lookalikes and isinstance(task, Task) and not isinstance(task, LookalikeTask)

    def _become(self, task: Task, kind: TaskKind) -> "_Definite":
        """Return what a task becomes among lookalikes, which is kept."""
        key = replace(task, optimal_steps=0)
        if key not in self._definite:
            if len(self._definite) == _KEPT:
                del self._definite[next(iter(self._definite))]
            self._definite[key] = self._draw_definite(task, kind)
        return self._definite[key]

    def _draw_definite(self, task: Task, kind: TaskKind) -> "_Definite":
        reason = ""
        for drawn in islice(draw_lookalikes(task, self.home), _DRAWS):
            try:
                goals = self.begin(drawn, kind).goals
                return _Definite(drawn, plan_team(self.oracles, goals) if self.oracles else None, kind)
            except TaskError as error:
                reason = str(error)
        raise TaskError(
            f"task {task.id!r}: in none of {_DRAWS} draws of lookalikes can it be solved; the last: {reason}"
        )

    def begin(self, task: AnyTask, kind: TaskKind = REARRANGE) -> Setting:
        """Lay out a task of a kind and put the robots at their starts.

        Raises:
            TaskError: the home cannot hold the task.
        """
        setting = kind.set_up(self.world, self.space, self.definite(task, kind))
        for robot, pose in zip(self.robots.values(), draw_starts(setting.task.seed, self._lattices), strict=True):
            robot.spawn(pose)
        return setting

    def solve(self, task: AnyTask, kind: TaskKind = REARRANGE) -> TeamPlan:
        """Begin a task and return the planner's plan of the robots that can grasp.

        Raises:
            TaskError: the task cannot be solved.
        """
        with uncollected():
            goals = self.begin(task, kind).goals
            if self._is_indefinite(task) and (known := self._become(task, kind)).kind is kind and known.plan:
                return known.plan
            return plan_team(self.oracles, goals)

    @property
    def oracle(self) -> Oracle:
        """The planner of the first robot that can grasp, in most environments the only one."""
        return next(iter(self.oracles.values()))

    def close(self) -> None:
        """Disconnect from physics."""
        self.world.close()
