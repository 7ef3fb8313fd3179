"""Whether tasks tell their L*, the fewest joint steps in which they can be solved."""

from typing import TYPE_CHECKING

from chmarl_pb.robots.registry import TEAM, team_of

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv


def tasks_say_optimum(env: "HouseholdEnv") -> bool:
    """Return whether robots and rules are the benchmark's, for which tasks say their L*."""
    return (
        env.simulation.pointer is None
        and not env.options.lookalikes
        and list(env.simulation.models.items()) == list(team_of(TEAM).items())
    )
