"""Advisers: what robots are told that they should have done instead of their last action."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from chmarl_pb.errors import TaskError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks import language
from chmarl_pb.tasks.feedback import better_action, within_sight
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulation import Stage
from chmarl_pb.tasks.task import Task


@runtime_checkable
class Adviser(Protocol):
    """Gives language feedback, e.g. ``feedback=MyAdviser()``.

    Each environment works with a copy of the object, which must be picklable; it may keep what it needs of an episode.
    """

    def begin(self, stage: Stage, task: Task, goal: Goal) -> None:
        """Watch an episode that begins on a stage."""

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of the robots' actions, by name, that are about to be taken after an outcome."""

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return robot -> sentence about its action in a step, counted from 0; robots left out are told nothing."""


class Critic(Protocol):
    """Watches the humanoid and knows what would have been better."""

    def before(self, action: str, outcome: Outcome) -> None:
        """Take note of the action that the humanoid is about to take in a state with that outcome."""

    def after(self, succeeded: bool) -> str | None:
        """Return the action that would have been better, or None, once the action has been taken."""


class MissedChance:
    """The paper's critic: notices a Pick or Place that would have worked and was not taken."""

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


class Detour:
    """The planner's critic: notices every action that does not shorten the optimal plan; plans anew only after such."""

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


class SpokenAdviser:
    """Says in plain English what a critic knows."""

    def __init__(self, critic: Callable[[Stage, Goal], Critic]):
        """Ask a critic of this kind in every episode."""
        self.critic = critic

    def begin(self, stage: Stage, task: Task, goal: Goal) -> None:
        """Watch an episode that begins on a stage."""
        self._task, self._item, self._critic = task, goal.item, self.critic(stage, goal)

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of the humanoid's action, and of what it holds."""
        self._action, self._holding = actions["humanoid"], outcome.held == self._item
        self._critic.before(self._action, outcome)

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return a sentence for the humanoid if something would have been better."""
        better = self._critic.after(succeeded["humanoid"])
        if better is None:
            return {}
        advice = language.Advice(self._action, succeeded["humanoid"], better, self._holding)
        return {"humanoid": language.say(self._task, step, advice)}


#: Style of feedback -> the critic behind it.
CRITICS: dict[str, Callable[[Stage, Goal], Critic]] = {"paper": MissedChance, "planner": Detour}
STYLES = tuple(CRITICS)
