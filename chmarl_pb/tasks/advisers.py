"""Advisers: what the humanoid should have done instead of its last action, in one of two styles."""

from collections.abc import Callable
from typing import Protocol

from chmarl_pb.errors import TaskError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.feedback import better_action, within_sight
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulation import Stage


class Adviser(Protocol):
    """Watches an episode and says what would have been better."""

    def before(self, action: str, outcome: Outcome) -> None:
        """Take note of the action that the humanoid is about to take in a state with that outcome."""

    def after(self, succeeded: bool) -> str | None:
        """Return the action that would have been better, or None, once the action has been taken."""


class PaperAdviser:
    """Notices a Pick or Place that would have worked and was not taken."""

    def __init__(self, stage: Stage, goal: Goal):
        """Watch an episode that begins on a stage."""
        self._humanoid, self._goal = stage.humanoid, goal
        self._missed: str | None = None

    def before(self, action: str, outcome: Outcome) -> None:
        """Ask whether Pick or Place would work now, unless that is what the humanoid does."""
        missed = within_sight(self._goal, outcome)
        if missed == action or (missed and self._humanoid.plan(missed, self._goal, outcome.seen["humanoid"]) is None):
            missed = None
        self._missed = missed

    def after(self, succeeded: bool) -> str | None:
        """Return the Pick or Place that was missed."""
        return self._missed


class PlannerAdviser:
    """Notices every action that does not shorten the optimal plan; plans anew only after such a one."""

    def __init__(self, stage: Stage, goal: Goal):
        """Plan an episode that begins on a stage."""
        self._oracle, self._goal = stage.oracle, goal
        self._plan = self._optimal()
        self._action = ""

    def before(self, action: str, outcome: Outcome) -> None:
        """Remember the action."""
        self._action = action

    def after(self, succeeded: bool) -> str | None:
        """Return the planned action if the action that was taken did not shorten the plan."""
        plan = self._plan
        if succeeded and plan and self._action == plan[0]:
            self._plan = plan[1:]
        elif succeeded and self._action != "stay":
            self._plan = self._optimal()
        return better_action(plan, self._action, self._plan)

    def _optimal(self) -> list[str] | None:
        try:
            return self._oracle.plan(self._goal)
        except TaskError:
            return None


#: Style of feedback -> who gives it.
ADVISERS: dict[str, Callable[[Stage, Goal], Adviser]] = {"paper": PaperAdviser, "planner": PlannerAdviser}
