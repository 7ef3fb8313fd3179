"""Whether a result is what its actions come to: they are played again, without the policy."""

from contextlib import closing
from dataclasses import dataclass

from chmarl_pb.envs.optimum import says_optimum
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import ActionError
from chmarl_pb.evaluation.metrics import Played
from chmarl_pb.evaluation.optimum import optimum
from chmarl_pb.evaluation.play import episode_seed
from chmarl_pb.evaluation.recognition import Recognition, recognition
from chmarl_pb.evaluation.result import Report
from chmarl_pb.tasks.task import Optimum

_SAME = 1e-6  # of potentials


@dataclass(frozen=True)
class _Again:
    """What the actions of an episode come to.

    Attributes:
        ending: steps, success and potential.
        ended: whether the episode was over with the last action.
        instruction: what was asked for.
        recognition: how often robots act on what they see; None for tasks of several objects.
    """

    ending: tuple[int, bool, float]
    ended: bool
    instruction: str
    recognition: Recognition | None


def what_differs(report: Report) -> str:
    """Play all episodes of a result again by their actions; return the first that differs, empty if none does.

    The instruction and the counts of recognition, which older results may not have, are compared where they are.

    Args:
        report: of an environment of this package alone, see :attr:`Report.foreign`.

    Raises:
        AssetError, HomeError: robots, things or a home are not here.
    """
    with closing(HouseholdEnv(split=report.settings["split"], **report.settings["options"])) as env:
        for episode in sorted(report.episodes, key=lambda episode: episode.task.home):
            if differs := _difference(env, episode):
                return f"task {episode.task.id}, seed {episode.seed}: {differs}"
    return ""


def _difference(env: HouseholdEnv, episode: Played) -> str:
    """Play an episode; return what it says otherwise, empty if nothing."""
    robots = len(env.possible_agents)
    if any(len(row) != robots for row in episode.actions):
        return f"it has steps without one action for each of the {robots} robots"
    try:
        again = _played_again(env, episode)
    except ActionError as error:
        return str(error)
    found, said = again.ending, (episode.steps, episode.success, episode.potential)
    if found[:2] != said[:2] or abs(found[2] - said[2]) > _SAME:
        words = "{} steps, success {}, potential {:g}"
        count = len(episode.actions)
        return f"it says {words.format(*said)}, but its {count} actions come to {words.format(*found)}"
    if len(episode.actions) != episode.steps or not again.ended:
        return f"it has {len(episode.actions)} actions, but the episode does not end with the last of them"
    return _told_otherwise(episode, again) or _other_optimum(env, episode)


def _told_otherwise(episode: Played, again: _Again) -> str:
    if episode.instruction not in ("", again.instruction):
        return f"it says that the instruction is {episode.instruction!r}, but it is {again.instruction!r}"
    if episode.recognition not in (None, again.recognition):
        return f"it counts {episode.recognition}, but its actions come to {again.recognition}"
    return ""


def _other_optimum(env: HouseholdEnv, episode: Played) -> str:
    if episode.success and episode.optimum != (known := _own_optimum(env)):
        own = episode.task.optimal_steps
        told, true = (best.steps if best else own for best in (episode.optimum, known))
        return f"it says that L* is {told}, but it is {true}"
    return ""


def _own_optimum(env: HouseholdEnv) -> Optimum | None:
    """Return L* of the task that was played, if the task does not say it; see :func:`optimum`."""
    return None if says_optimum(env, env.task) else optimum(env)


def _played_again(env: HouseholdEnv, episode: Played) -> _Again:
    env.reset(seed=episode_seed(episode.task, episode.seed), options={"task": episode.task})
    outcomes, played = [], []
    for row in episode.actions:
        if not env.agents:
            break
        outcomes.append(env.outcome)
        played.append(dict(zip(env.possible_agents, row, strict=True)))
        env.step(played[-1])
    ending = env.steps, env.outcome.success, float(env.outcome.potential)
    return _Again(ending, not env.agents, env.instruction, recognition(env, outcomes, played))
