"""Advisers: what robots are told that they should have done instead of their last action."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from chmarl_pb.errors import TaskError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks import language
from chmarl_pb.tasks.feedback import better_action, within_sight
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulation import Stage
from chmarl_pb.tasks.targets import target_of
from chmarl_pb.tasks.tidy_task import AnyTask

Goals = tuple[Goal, ...]


@runtime_checkable
class Adviser(Protocol):
    """Gives language feedback, e.g. ``feedback=MyAdviser()``.

    Each environment works with a copy of the object, which must be picklable; it may keep what it needs of an episode.

    >>> class Countdown:
    ...     def begin(self, stage, task, goals):
    ...         self.optimal = task.optimal_steps
    ...
    ...     def before(self, actions, outcome):
    ...         pass
    ...
    ...     def after(self, succeeded, step):
    ...         return {"humanoid": f"The planner would need {self.optimal - step - 1} more steps."}
    >>> env = chmarl_pb.parallel_env(feedback=Countdown(), split="val-unseen")
    >>> _ = env.reset(options={"task": "val-unseen-000"})
    >>> env.step({"humanoid": 9, "drone": 8})[-1]["humanoid"]["feedback"]
    'The planner would need 5 more steps.'
    """

    def begin(self, stage: Stage, task: AnyTask, goals: Goals) -> None:
        """Watch an episode that begins on a stage, where goals are to be reached."""

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

    def __init__(self, stage: Stage, goals: Goals):
        """Watch an episode that begins on a stage."""
        self._humanoid, self._goals = stage.humanoid, goals
        self._missed: str | None = None

    def before(self, action: str, outcome: Outcome) -> None:
        """Ask whether Pick or Place would work now, unless that is what the humanoid does."""
        seen = outcome.seen["humanoid"]
        goal = target_of(self._goals, outcome.state, "humanoid", seen)
        missed = within_sight(goal, outcome)
        if missed == action or (missed and self._humanoid.plan(missed, goal, seen) is None):
            missed = None
        self._missed = missed

    def after(self, succeeded: bool) -> str | None:
        """Return the Pick or Place that was missed."""
        return self._missed


class Detour:
    """The planner's critic: notices every action that does not shorten the optimal plan; plans anew only after such."""

    def __init__(self, stage: Stage, goals: Goals):
        """Plan an episode that begins on a stage."""
        self._oracle, self._goals = stage.oracle, goals
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
            return plan_all(self._oracle, self._goals).actions
        except TaskError:
            return None


class SpokenAdviser:
    """Says in plain English what a critic knows."""

    def __init__(self, critic: Callable[[Stage, Goals], Critic]):
        """Ask a critic of this kind in every episode."""
        self.critic = critic

    def begin(self, stage: Stage, task: AnyTask, goals: Goals) -> None:
        """Watch an episode that begins on a stage."""
        self._task, self._goals, self._critic = task, goals, self.critic(stage, goals)

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of the humanoid's action, and of what it holds."""
        goal = target_of(self._goals, outcome.state, "humanoid", outcome.seen["humanoid"])
        self._action, self._holding = actions["humanoid"], outcome.held == goal.item
        self._move = self._task.moves[self._goals.index(goal)]
        self._critic.before(self._action, outcome)

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return a sentence for the humanoid if something would have been better."""
        better = self._critic.after(succeeded["humanoid"])
        if better is None:
            return {}
        advice = language.Advice(self._action, succeeded["humanoid"], better, self._holding)
        return {"humanoid": language.say(self._move, step, advice)}


#: Style of feedback -> the critic behind it.
CRITICS: dict[str, Callable[[Stage, Goals], Critic]] = {"paper": MissedChance, "planner": Detour}
STYLES = tuple(CRITICS)
