"""Play one task and note all that is worth showing."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import Episode, rollout
from chmarl_pb.errors import ResultError
from chmarl_pb.evaluation.episode_file import EpisodeFile
from chmarl_pb.evaluation.optimum import optimum
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.frames.motion_player import Scene, scene_during, scene_of
from chmarl_pb.frames.recording import Moment, Recording, board_of
from chmarl_pb.homes.home import load_home
from chmarl_pb.policies.policy import Infos, Policy
from chmarl_pb.policies.registry import make_policy
from chmarl_pb.policies.replay import ReplayPolicy
from chmarl_pb.rendering.movables import team_in
from chmarl_pb.sensing.scene_graph import SceneGraph
from chmarl_pb.tasks.messages import Messages
from chmarl_pb.tasks.splits import load_tasks
from chmarl_pb.tasks.task import Task

_LENGTHS = range(6, 10)  # joint steps of an episode that is good to watch


@dataclass(frozen=True)
class Noted:
    """What is read from the environment after a step, before the next one changes it; see :class:`Moment`."""

    motion: tuple[Scene, ...]
    rest: Scene
    messages: Messages | None
    graphs: dict[str, SceneGraph]
    carriers: dict[str, str]


def record(
    task: Task,
    observation: str,
    policy: str = "planner",
    on_step: Callable[[], None] = lambda: None,
    **options: Any,
) -> Recording:
    """Play a task with driven motions and note every step.

    Args:
        task: the task.
        observation: "visual" or "scene_graph".
        policy: "planner", "search" or "random".
        on_step: called after every step.
        **options: of the environment, as ``robots``.

    Raises:
        OptionError: an option or the policy is unknown.
        TaskError: the task cannot be set up.
    """
    env = HouseholdEnv(observation, **{"home": task.home, "execution": "simulated"} | options)
    return _recorded(env, task, lambda: make_policy(policy, env), policy, on_step)


def record_file(file: EpisodeFile, on_step: Callable[[], None] = lambda: None) -> Recording:
    """Play the actions of an episode file with driven motions and note every step; see :func:`record`.

    Raises:
        ResultError: the episode was played in another home, goes another way than the file says, or has a task of
            several objects.
    """
    if not isinstance(file.task, Task):
        raise ResultError(f"{file.task.id} has several objects; episodes of one object are shown")
    if home_hash(file.task.home) != file.home_sha256:
        raise ResultError(f"the home {file.task.home} is not the one that the episode was played in; save it again")
    options = file.options | {"execution": "simulated"}
    env, task = HouseholdEnv(home=file.task.home, **options), file.task
    recording = _recorded(env, task, lambda: ReplayPolicy(file.actions, env, file.said), file.policy, on_step)
    if (recording.steps, recording.success) != (len(file.actions), file.success):
        raise ResultError("the episode goes another way than its file says; `chmarl-pb episode replay` says where")
    return recording


def _recorded(
    env: HouseholdEnv, task: Task, make: Callable[[], Policy], name: str, on_step: Callable[[], None]
) -> Recording:
    """Play one episode and close the environment."""
    try:
        noted: list[Noted] = []

        def watch(env: HouseholdEnv) -> None:
            noted.append(note(env))
            if env.steps:
                on_step()

        episode = rollout(env, make(), seed=task.seed, task=task, on_step=watch)
        return recording_of(env, name, _moments(env, episode, noted))
    finally:
        env.close()


def choose_task() -> Task:
    """Return the first test-unseen task of moderate length that leads from one room into another."""
    tasks = load_tasks("test-unseen")
    return next((task for task in tasks if task.optimal_steps in _LENGTHS and _leads_on(task)), tasks[0])


def _leads_on(task: Task) -> bool:
    """Return whether no room has both a source and a target of the task."""
    things = load_home(task.home).receptacles.values()
    sources = {thing.room for thing in things if thing.class_name == task.source}
    return sources.isdisjoint(thing.room for thing in things if thing.class_name == task.target)


def note(env: HouseholdEnv) -> Noted:
    """Return how the last step went: its scenes at 30 Hz, the scene after it, and what holds then."""
    rest = scene_of(env.world)
    motion = tuple(scene_during(snapshot, rest) for snapshot in env.snapshots)
    outcome, states = env.outcome, env.setting.states
    graphs = {name: env.simulation.graphs.graph(outcome.state, seen, states) for name, seen in outcome.seen.items()}
    carriers = {item: support.receptacle for item, support in outcome.supports.items()}
    held = {grip.item: name for name, grip in outcome.state.grips.items()}
    return Noted(
        motion,
        rest,
        board_of(env.messages, env.rooms, env.hears_board),
        graphs,
        carriers | held,
    )


def moment_of(
    env: HouseholdEnv, noted: Noted, infos: Infos, chosen: dict[str, int], said: dict[str, int], reward: float
) -> Moment:
    """Return the moment of a step.

    Args:
        env: where it was done.
        noted: how it went.
        infos: robot -> info that it gave.
        chosen: robot -> number of its action; empty at the start.
        said: robot -> symbol that it said; empty without own words.
        reward: shared, of the step.
    """
    return Moment(
        {name: env.action_names[name][number] for name, number in chosen.items()},
        {name: info["action_success"] for name, info in infos.items()},
        reward,
        infos[env.possible_agents[0]]["potential"],
        noted.messages,
        {name: info["feedback"] for name, info in infos.items()},
        {name: info["visible"] for name, info in infos.items()},
        noted.motion,
        noted.rest,
        said,
        noted.graphs,
        noted.carriers,
    )


def recording_of(env: HouseholdEnv, policy: str, moments: tuple[Moment, ...]) -> Recording:
    """Return the recording of the episode that an environment is in.

    Args:
        env: the environment; its task has one object.
        policy: name of what drove the robots.
        moments: the start and every step.
    """
    assert isinstance(env.task, Task)
    return Recording(
        env.task, env.simulation.home, team_in(env.world, env.simulation.models), optimum(env), env.instruction, policy,
        env.options.observation_name, env.rooms, env.setting.goal.item, env.setting.goal.receptacles, moments,
        env.outcome.success, env.collisions, env.setting.states,
    )  # fmt: skip


def _moments(env: HouseholdEnv, episode: Episode, noted: list[Noted]) -> tuple[Moment, ...]:
    steps = zip(
        noted, episode.infos, ({}, *episode.actions), ({}, *episode.said), (0.0, *episode.rewards.tolist()), strict=True
    )
    return tuple(moment_of(env, *step) for step in steps)
