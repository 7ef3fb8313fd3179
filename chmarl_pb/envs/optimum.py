"""Whether a task tells its L*, the fewest joint steps in which it can be solved."""

from typing import TYPE_CHECKING

from chmarl_pb.robots.registry import TEAM, team_of

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.tasks.tidy_task import AnyTask


def says_optimum(env: "HouseholdEnv", task: "AnyTask") -> bool:
    """Return whether a task says its L*, and robots and rules are the benchmark's, for which it does."""
    return (
        task.optimal_steps > 0
        and env.simulation.pointer is None
        and not env.options.lookalikes
        and list(env.simulation.models.items()) == list(team_of(TEAM).items())
    )
