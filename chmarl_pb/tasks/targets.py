"""Which object Pick and Place are about, as they take no argument."""

from collections.abc import Sequence

import numpy as np

from chmarl_pb.robots.goal import Goal
from chmarl_pb.world import WorldState


def is_done(goal: Goal, state: WorldState) -> bool:
    """Return whether a goal's object stands on one of its receptacles."""
    support = state.objects.supports.get(goal.item)
    return support is not None and support.receptacle in goal.receptacles


def target_of(goals: Sequence[Goal], state: WorldState, robot: str, seen: Sequence[str]) -> Goal:
    """Return the goal that a robot's Pick or Place is about.

    That of the object that it holds. If it holds none: of the objects that it sees, that nobody holds and that do not
    stand where they belong yet, the nearest, by the distance along the floor from the robot's base to the object's
    bottom centre; of equally near ones, the one that the instruction names first. If it sees none: the first that is
    not done yet.

    Args:
        goals: of the task, in the order of its instruction.
        state: of the world.
        robot: its name.
        seen: names of the things that it sees.
    """
    if len(goals) == 1:
        return goals[0]
    if grip := state.grips.get(robot):
        return next((goal for goal in goals if goal.item == grip.item), goals[0])
    left = [goal for goal in goals if goal.item not in state.held and not is_done(goal, state)] or list(goals)
    x, y, _ = state.robots[robot].base[0]

    def distance(goal: Goal) -> float:
        place = state.objects.poses[goal.item][0]
        return float(np.hypot(place[0] - x, place[1] - y))

    return min((goal for goal in left if goal.item in seen), key=distance, default=left[0])
