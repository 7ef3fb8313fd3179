"""L*: the fewest joint steps in which the robots of an environment can solve a task."""

from chmarl_pb.envs.optimum import says_optimum, succeeds_by_goals
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import rollout
from chmarl_pb.errors import OptionError
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.tasks.task import Optimum
from chmarl_pb.tasks.tidy_task import AnyTask


def optimum(env: HouseholdEnv) -> Optimum:
    """Return L* of the task that an environment has played; it lays the task out anew and so ends the episode.

    Where a kind of the user's own says by itself what success is, it is the number of steps after which the planner
    has it, on its way to all goals of the setting; nothing proves that there is no shorter way.

    Raises:
        TaskError: the planner cannot solve the task with these robots.
    """
    if says_optimum(env, env.task):
        return Optimum(env.task.optimal_steps)
    plan = env.simulation.solve(env.task, env.options.kind)
    if succeeds_by_goals(env.options.kind):
        return Optimum(plan.steps, plan.proven)
    try:
        episode = rollout(env, make_policy("planner", env), task=env.task)
    except OptionError:  # it cannot drive robots without the usual actions
        return Optimum(plan.steps, False)
    return Optimum(episode.steps if episode.success else plan.steps, False)


def optimal_steps(env: HouseholdEnv, task: AnyTask) -> int:
    """Return L* of any task for the robots of an environment, whose episode it ends; see :func:`optimum`."""
    if says_optimum(env, task):
        return task.optimal_steps
    env.reset(options={"task": task})
    return optimum(env).steps
