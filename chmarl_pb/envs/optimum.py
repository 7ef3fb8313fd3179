"""Whether a task tells its L*, the fewest joint steps in which it can be solved."""

from typing import TYPE_CHECKING

from chmarl_pb.robots.registry import TEAM, team_of
from chmarl_pb.tasks.kinds import Rearrange, TaskKind, Tidy

if TYPE_CHECKING:
    from chmarl_pb.envs.parallel import HouseholdEnv
    from chmarl_pb.tasks.tidy_task import AnyTask

_KINDS = (Rearrange, Tidy)


def says_optimum(env: "HouseholdEnv", task: "AnyTask") -> bool:
    """Return whether a task says its L*, and robots and rules are the benchmark's, for which it does."""
    kind = env.options.kind
    return (
        task.optimal_steps > 0
        and env.simulation.pointer is None
        and not env.options.lookalikes
        and list(env.simulation.models.items()) == list(team_of(TEAM).items())
        and _is_as_in(kind, _KINDS, "set_up")
        and succeeds_by_goals(kind)
    )


def succeeds_by_goals(kind: TaskKind) -> bool:
    """Return whether a task of a kind is solved as soon as all its goals are reached, and never before."""
    return _is_as_in(kind, _KINDS, "outcome")


def _is_as_in(kind: TaskKind, bases: tuple[type, ...], method: str) -> bool:
    return any(isinstance(kind, base) and getattr(type(kind), method) is getattr(base, method) for base in bases)
