"""Advisers: what robots are told that they should have done instead of their last action."""

from collections.abc import Callable
from typing import Protocol, runtime_checkable

from chmarl_pb.catalog import class_of
from chmarl_pb.errors import TaskError
from chmarl_pb.robots.goal import Goal
from chmarl_pb.robots.robot import taken_cells
from chmarl_pb.tasks import language
from chmarl_pb.tasks.feedback import better_action, within_sight
from chmarl_pb.tasks.order import plan_all
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.simulation import Simulation
from chmarl_pb.tasks.targets import target_of
from chmarl_pb.tasks.task import Task
from chmarl_pb.tasks.tidy_task import AnyTask

Goals = tuple[Goal, ...]


@runtime_checkable
class Adviser(Protocol):
    """Gives language feedback, e.g. ``feedback=MyAdviser()``.

    Each environment works with a copy of the object, which must be picklable; it may keep what it needs of an episode.

    >>> class Countdown:
    ...     def begin(self, simulation, task, goals):
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

    def begin(self, simulation: Simulation, task: AnyTask, goals: Goals) -> None:
        """Watch an episode that begins in a simulation, where goals are to be reached."""

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of the robots' actions, by name, that are about to be taken after an outcome."""

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return robot -> sentence about its action in a step, counted from 0; robots left out are told nothing."""


class Critic(Protocol):
    """Watches a robot with an arm and knows what would have been better."""

    def before(self, action: str, outcome: Outcome) -> None:
        """Take note of the action that the robot is about to take in a state with that outcome."""

    def after(self, succeeded: bool) -> str | None:
        """Return the action that would have been better, or None, once the action has been taken."""


#: Makes the critic of a robot in an episode that begins in a simulation, where goals are to be reached.
MakeCritic = Callable[[Simulation, str, Goals], Critic]


class MissedChance:
    """The paper's critic: notices a Pick or Place that would have worked and was not taken."""

    def __init__(self, simulation: Simulation, robot: str, goals: Goals):
        """Watch a robot in an episode that begins in a simulation."""
        self._oracle, self._goals = simulation.oracles[robot], goals
        self._missed: str | None = None

    def before(self, action: str, outcome: Outcome) -> None:
        """Ask whether Pick or Place would work now, unless that is what the robot does."""
        robot = self._oracle.robot
        goal = target_of(self._goals, outcome.state, robot.name, outcome.seen[robot.name])
        missed = within_sight(goal, outcome, robot.name)
        if missed and missed != action:
            useful = list(self._oracle.useful(goal, self._goals, taken_cells(robot)))
            missed = missed if useful and action not in useful else None
        self._missed = None if missed == action else missed

    def after(self, succeeded: bool) -> str | None:
        """Return the Pick or Place that was missed."""
        return self._missed


class Detour:
    """The planner's critic: notices every action that does not shorten the optimal plan; plans anew only after such."""

    def __init__(self, simulation: Simulation, robot: str, goals: Goals):
        """Plan for a robot in an episode that begins in a simulation."""
        self._oracle, self._goals = simulation.oracles[robot], goals
        self._helped = len(simulation.oracles) > 1
        self._plan = self._optimal()
        self._action = ""

    def before(self, action: str, outcome: Outcome) -> None:
        """Remember the action; where others have arms, too, they may have changed the plan since."""
        self._action = action
        if self._helped:
            self._plan = self._optimal()

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

    def __init__(self, critic: MakeCritic, templates: int = 1):
        """Ask a critic of this kind about each robot with an arm in every episode.

        Args:
            critic: makes one.
            templates: revision of the sentences.
        """
        self.critic, self._templates = critic, templates

    def begin(self, simulation: Simulation, task: AnyTask, goals: Goals) -> None:
        """Watch an episode that begins in a simulation."""
        self._task, self._goals, self._catalog = task, goals, simulation.home.catalog
        self._critics = {robot: self.critic(simulation, robot, goals) for robot in simulation.oracles}

    def before(self, actions: dict[str, str], outcome: Outcome) -> None:
        """Take note of the actions, and of what they are taken after."""
        self._actions, self._outcome = actions, outcome
        for robot, critic in self._critics.items():
            critic.before(actions[robot], outcome)

    def after(self, succeeded: dict[str, bool], step: int) -> dict[str, str]:
        """Return a sentence for each robot for which something would have been better."""
        feedback = {}
        for robot, critic in self._critics.items():
            better = critic.after(succeeded[robot])
            if better is not None:
                feedback[robot] = self._say(robot, succeeded[robot], better, step)
        return feedback

    def _say(self, robot: str, succeeded: bool, better: str, step: int) -> str:
        """Return a sentence about what would have been better."""
        outcome = self._outcome
        goal = target_of(self._goals, outcome.state, robot, outcome.seen[robot])
        grip = outcome.state.grips.get(robot)
        holding = grip is not None and grip.item == goal.item
        advice = language.Advice(self._actions[robot], succeeded, better, holding)
        return language.say(_move_of(self._task, goal), step, advice, self._catalog, self._templates)


def _move_of(task: AnyTask, goal: Goal) -> Task:
    """Return the move that a goal is of, which names X and Y; kinds of one's own may have goals beside the moves."""
    target = class_of(goal.receptacles[0])
    named = (move for move in task.moves if (move.item, move.target) == (goal.item, target))
    return next(named, None) or Task(task.id, task.home, class_of(goal.item), "", target, task.seed)


#: Style of feedback -> the critic behind it.
CRITICS: dict[str, MakeCritic] = {"paper": MissedChance, "planner": Detour}
STYLES = tuple(CRITICS)
