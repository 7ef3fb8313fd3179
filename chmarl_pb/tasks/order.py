"""The planner over several goals: in which order they are reached in the fewest steps."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack, suppress
from typing import NamedTuple

from chmarl_pb.errors import TaskError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.pointing import place_of
from chmarl_pb.robots.robot import taken_cells
from chmarl_pb.tasks.planner import Oracle
from chmarl_pb.tasks.targets import is_done


class Plan(NamedTuple):
    """A robot's actions, and the goals in the order in which they reach them."""

    actions: list[str]
    goals: tuple[Goal, ...]


class TeamPlan(NamedTuple):
    """What the robots that can grasp do.

    Attributes:
        plans: robot -> its plan.
        proven: whether no joint plan takes fewer steps; if not, its length is an upper bound of L*.
    """

    plans: dict[str, Plan]
    proven: bool

    @property
    def steps(self) -> int:
        """Joint steps until all goals are reached."""
        return max(len(plan.actions) for plan in self.plans.values())


def plan_team(oracles: Mapping[str, Oracle], goals: Sequence[Goal]) -> TeamPlan:
    """Return a plan of all robots that can grasp from the present state; those that do not grasp stay.

    One goal is reached by the robot that is there first. Several goals are given to the robots one by one, always the
    goal and the robot that are ready first; one robot alone takes the best order.

    Raises:
        TaskError: the goals cannot all be reached.
    """
    if len(oracles) == 1:
        ((name, oracle),) = oracles.items()
        plan = plan_all(oracle, goals)
        proven = len(goals) == 1 and not _others(oracle) and oracle.surely_shortest(plan.actions)
        return TeamPlan({name: plan}, proven)
    plans = _share_out(oracles, goals)
    longest = max(len(plan.actions) for plan in plans.values())
    proven = len(goals) == 1 and longest <= _least(oracles, goals[0])
    return TeamPlan(plans, proven and all(oracles[name].surely_shortest(plan.actions) for name, plan in plans.items()))


def _others(oracle: Oracle) -> bool:
    """Return whether other robots may be in the way of a planner's robot."""
    return bool(taken_cells(oracle.robot))


def _least(oracles: Mapping[str, Oracle], goal: Goal) -> int:
    """Return the fewest steps in which any robot reaches a goal with nobody in its way."""
    lengths = []
    for oracle in oracles.values():
        with suppress(TaskError):
            lengths.append(len(oracle.plan(goal, alone=True)))
    return min(lengths, default=0)


def _share_out(oracles: Mapping[str, Oracle], goals: Sequence[Goal]) -> dict[str, Plan]:
    plans = {name: Plan([], ()) for name in oracles}
    world = next(iter(oracles.values())).world
    with ExitStack() as played:
        while left := [goal for goal in goals if not is_done(goal, world.state)]:
            name, goal, way = _soonest(oracles, plans, left, goals)
            plans[name] = Plan([*plans[name].actions, *way], (*plans[name].goals, goal))
            played.enter_context(oracles[name].acting(way, goal))
    world.sync()
    return plans


def _soonest(
    oracles: Mapping[str, Oracle], plans: Mapping[str, Plan], left: Sequence[Goal], goals: Sequence[Goal]
) -> tuple[str, Goal, list[str]]:
    """Return the robot and the goal that are ready first, and the robot's way to it."""
    best: tuple[str, Goal, list[str]] | None = None
    reason = ""
    for name, oracle in oracles.items():
        own = [goal for goal in left if goal.item == oracle.robot.held] or left
        for goal in own:
            try:
                way = oracle.plan(goal, goals)
            except TaskError as error:
                reason = str(error)
                continue
            if best is None or len(plans[name].actions) + len(way) < len(plans[best[0]].actions) + len(best[2]):
                best = name, goal, way
    if best is None:
        raise TaskError(f"the objects cannot all be brought to where they belong; the last reason: {reason}")
    return best


def plan_all(oracle: Oracle, goals: Sequence[Goal]) -> Plan:
    """Return the shortest plan over all orders of goals from the present state.

    Each goal is reached by the shortest way from where the last one has left the robot; among equally short ways the
    planner knows one. So for several goals the length is an upper bound of the optimum, and nearly always the optimum.

    Raises:
        TaskError: in no order can all goals be reached.
    """
    if len(goals) == 1:
        return Plan(oracle.plan(goals[0]), tuple(goals))
    search = _Search(oracle, goals)
    try:
        search.extend(Plan([], ()))
    finally:
        oracle.world.sync()
    if search.best is None:
        raise TaskError(f"the objects cannot all be brought to where they belong; the last reason: {search.reason}")
    return search.best


class _Search:
    """Depth first, the shortest way to a goal first; what cannot be shorter than the best plan is cut off."""

    def __init__(self, oracle: Oracle, goals: Sequence[Goal]):
        self.oracle, self.goals = oracle, tuple(goals)
        self.best: Plan | None = None
        self.carrying: dict[Goal, int] = {}  # steps from Pick to Place of each goal, from wherever it is picked
        self.reason = ""

    def extend(self, plan: Plan) -> None:
        """Try all orders of the goals that are left in the world's present state."""
        state = self.oracle.world.state
        left = [goal for goal in self.goals if not is_done(goal, state)]
        least = len(plan.actions) + sum(self.carrying.get(goal, 1) for goal in left)
        if self.best is not None and least >= len(self.best.actions):
            return
        if not left:
            self.best = plan
        held = [goal for goal in left if goal.item == self.oracle.robot.held]
        for way, goal in sorted(self._ways(held or left), key=lambda found: len(found[0])):
            try:
                with self.oracle.acting(way, goal):
                    self.extend(Plan([*plan.actions, *way], (*plan.goals, goal)))
            except TaskError as error:
                self.reason = str(error)

    def _ways(self, goals: Sequence[Goal]) -> list[tuple[list[str], Goal]]:
        """Return the shortest way to each goal that can be reached now."""
        ways = []
        for goal in goals:
            try:
                way = self.oracle.plan(goal, self.goals)
                ways.append((way, goal))
                self.carrying.setdefault(goal, len(way) - (place_of(way, "pick") or 0))
            except TaskError as error:
                self.reason = str(error)
        return ways
