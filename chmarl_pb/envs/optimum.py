"""Whether a task tells its L*, the fewest joint steps in which it can be solved."""

from typing import TYPE_CHECKING

from chmarl_pb.catalog import class_of
from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.tasks.kinds import Rearrange, Tidy

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.tasks.tidy_task import AnyTask


def says_optimum(env: "HouseholdEnv", task: "AnyTask") -> bool:
    """Return whether a task says its L*, and robots, rules and goals are the benchmark's, for which it does."""
    return (
        task.optimal_steps > 0
        and env.simulation.pointer is None
        and not env.options.lookalikes
        and list(env.simulation.models.items()) == list(team_of(TEAM).items())
        and (type(env.options.kind) in (Rearrange, Tidy) or _wants_its_moves(env, task))
    )


def _wants_its_moves(env: "HouseholdEnv", task: "AnyTask") -> bool:
    """Return whether an environment plays a task now, and its goals are the task's moves; own kinds may have others."""
    setting = getattr(env, "setting", None)
    if setting is None or setting.task != task:
        return False
    goals = [(goal.item, class_of(goal.receptacles[0])) for goal in setting.goals]
    return goals == [(move.item, move.target) for move in task.moves]
