"""When a robot is told what it should have done (the paper's style: a missed pick or place)."""

from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks import language
from chmarl_pb.tasks.outcome import Outcome
from chmarl_pb.tasks.task import Task


def feedback(task: Task, goal: Goal, previous: Outcome, robot: str, action: str) -> str:
    """Return what to tell a robot about its last action; an empty string if there is nothing to say.

    Args:
        task: the task.
        goal: X and Y.
        previous: the outcome on which the robot acted.
        robot: its name; only the humanoid can pick and place.
        action: name of the action that it took.
    """
    if robot != "humanoid":
        return ""
    seen = previous.seen[robot]
    if previous.held is None and goal.item in seen and action != "pick":
        return language.missed_pick(task, action)
    if previous.held == goal.item and not set(goal.receptacles).isdisjoint(seen) and action != "place":
        return language.missed_place(task, action)
    return ""
