"""The planner over several goals: in which order they are reached in the fewest steps."""

from collections.abc import Sequence
from typing import NamedTuple

from chmarl_pb.errors import TaskError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.planner import Oracle
from chmarl_pb.tasks.targets import is_done


class Plan(NamedTuple):
    """The humanoid's actions, and the goals in the order in which they reach them."""

    actions: list[str]
    goals: tuple[Goal, ...]


def plan_all(oracle: Oracle, goals: Sequence[Goal]) -> Plan:
    """Return the shortest plan over all orders of goals from the present state.

    Each goal is reached by the shortest way from where the last one has left the humanoid; among equally short ways the
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
        held = [goal for goal in left if goal.item in state.held]
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
                self.carrying.setdefault(goal, len(way) - way.index("pick") if "pick" in way else len(way))
            except TaskError as error:
                self.reason = str(error)
        return ways
