"""Whether a result is what its actions come to: they are played again, without the policy."""

from contextlib import closing

from chmarl_pb.envs.optimum import says_optimum
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.optimum import optimum
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.result import Report
from chmarl_pb.tasks.task import Optimum

_SAME = 1e-6  # of potentials


def what_differs(report: Report) -> str:
    """Play all episodes of a result again by their actions; return the first that ends otherwise, empty if none does.

    Args:
        report: of an environment of this package alone, see :attr:`Report.foreign`.

    Raises:
        AssetError, HomeError: robots, things or a home are not here.
    """
    with closing(HouseholdEnv(split=report.settings["split"], **report.settings["options"])) as env:
        for episode in sorted(report.episodes, key=lambda episode: episode.task.home):
            found = _ending(env, episode)
            said = episode.steps, episode.success, episode.potential
            if found[:2] != said[:2] or abs(found[2] - said[2]) > _SAME:
                words = "{} steps, success {}, potential {:g}"
                return (
                    f"task {episode.task.id}, seed {episode.seed}: it says {words.format(*said)}, but its "
                    f"{len(episode.actions)} actions come to {words.format(*found)}"
                )
            if episode.success and episode.optimum != (known := _own_optimum(env)):
                own = episode.task.optimal_steps
                told, true = (best.steps if best else own for best in (episode.optimum, known))
                return f"task {episode.task.id}, seed {episode.seed}: it says that L* is {told}, but it is {true}"
    return ""


def _own_optimum(env: HouseholdEnv) -> Optimum | None:
    """Return L* of the task that was played, if the task does not say it; see :func:`optimum`."""
    return None if says_optimum(env, env.task) else optimum(env)


def _ending(env: HouseholdEnv, episode: Played) -> tuple[int, bool, float]:
    """Return the steps, success and potential that the actions of an episode come to."""
    env.reset(seed=episode_seed(episode.task, episode.seed), options={"task": episode.task})
    for row in episode.actions:
        if not env.agents:
            break
        env.step(dict(zip(env.possible_agents, row, strict=True)))
    return env.steps, env.outcome.success, float(env.outcome.potential)
