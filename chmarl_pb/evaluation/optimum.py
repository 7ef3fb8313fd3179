"""L*: the fewest joint steps in which the robots of an environment can solve a task."""

from chmarl_pb.envs.optimum import says_optimum as says_optimum
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.tasks.task import Optimum as Optimum
from chmarl_pb.tasks.tidy_task import AnyTask


def optimum(env: HouseholdEnv) -> Optimum:
    """Return L* of the task that an environment has played; it lays the task out anew and so ends the episode.

    Raises:
        TaskError: the planner cannot solve the task with these robots.
    """
    if says_optimum(env, env.task):
        return Optimum(env.task.optimal_steps)
    plan = env.simulation.solve(env.task, env.options.kind)
    return Optimum(plan.steps, plan.proven)


def optimal_steps(env: HouseholdEnv, task: AnyTask) -> int:
    """Return L* of any task for the robots of an environment, whose episode it ends; see :func:`optimum`."""
    if says_optimum(env, task):
        return task.optimal_steps
    env.reset(options={"task": task})
    return optimum(env).steps
