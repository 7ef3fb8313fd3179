"""When a robot with an arm is told what it should have done.

Two styles. ``paper`` (CH-MARL): it could have picked X, or placed it on Y, and did something else.
``planner``: it did something that does not shorten the optimal plan. Whether Pick or Place would
have worked, and what the optimal plan was, is for those who know the robots and the planner to find
out; here is what follows from it.
"""

from chmarl_pb.robots.goal import Goal
from chmarl_pb.tasks.outcome import Outcome


def within_sight(goal: Goal, outcome: Outcome, robot: str) -> str | None:
    """Return "pick" or "place" if a robot sees what that needs and its hand is ready for it, else None."""
    seen, grip = outcome.seen[robot], outcome.state.grips.get(robot)
    if grip is None:
        return "pick" if goal.item in seen and goal.item in outcome.supports else None
    if grip.item == goal.item and not set(goal.receptacles).isdisjoint(seen):
        return "place"
    return None


def better_action(plan: list[str] | None, action: str, plan_after: list[str] | None) -> str | None:
    """Return what would have shortened the optimal plan, or None if the action did so.

    Args:
        plan: the optimal plan before the action; None if there is none.
        action: name of the action that was taken.
        plan_after: the optimal plan after it.
    """
    if not plan or plan_after is None or plan[0] == action or len(plan_after) < len(plan):
        return None
    return plan[0]
