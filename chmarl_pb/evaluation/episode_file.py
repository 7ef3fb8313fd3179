"""Episode files: one played episode as a small JSON file that another machine can replay and check."""

import json
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import chmarl_pb
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.rollout import OnStep, rollout
from chmarl_pb.errors import OptionError, ResultError
from chmarl_pb.evaluation.json_file import WRONG, plain, read_object
from chmarl_pb.evaluation.provenance import home_hash
from chmarl_pb.evaluation.state_hash import state_hash
from chmarl_pb.files import write_atomically
from chmarl_pb.policies.policy import Policy
from chmarl_pb.policies.replay import ReplayPolicy
from chmarl_pb.robots.registry import TEAM
from chmarl_pb.tasks.tidy_task import AnyTask, task_of

FORMAT = "chmarl-pb episode 1"
_OPTIONS = ("observation", "messages", "feedback", "max_steps", "image_size", "execution")
_DEFAULTS: dict[str, Any] = {
    "robots": TEAM,
    "task": "rearrange",
    "catalog": None,
    "pointing": False,
    "lookalikes": False,
    "templates": 1,
}  # options that are there if they are others


@dataclass(frozen=True)
class EpisodeFile:
    """All that is needed to play an episode again and to see that it goes the same way; T joint steps.

    Attributes:
        task: the task.
        policy: name of the policy that played it.
        seed: of the episode.
        options: of the environment: observation, messages, feedback, max_steps, image_size, execution; robots,
            task, catalog, pointing, lookalikes and templates where they are not the benchmark's.
        actions: T times the number of each robot's action.
        rewards: T shared rewards.
        states: T + 1 state hashes, the first after the reset.
        success: whether X stands on Y at the end.
        home_sha256: of the home.
        said: T times the symbol that each robot said; empty without own words.
        library: version of this package.
        format: of the file.
    """

    task: AnyTask
    policy: str
    seed: int | None
    options: dict[str, Any]
    actions: tuple[tuple[int, ...], ...]
    rewards: tuple[float, ...]
    states: tuple[str, ...]
    success: bool
    home_sha256: str
    said: tuple[tuple[int, ...], ...] = ()
    library: str = chmarl_pb.__version__
    format: str = FORMAT


def record_episode(
    env: HouseholdEnv,
    policy: Policy,
    name: str,
    seed: int | None,
    task: AnyTask | str,
    on_step: OnStep = lambda env: None,
    policy_seed: int | None = None,
) -> EpisodeFile:
    """Play an episode and return its file.

    Args:
        env: to play in.
        policy: drives the robots.
        name: of the policy, for the file.
        seed: of the episode.
        task: the task to play, or its id.
        on_step: watches, see :func:`chmarl_pb.envs.rollout.rollout`.
        policy_seed: of the policy, if it is not to get that of the episode.

    Raises:
        OptionError: the environment was given objects.
    """
    options = plain_options(env)
    states: list[str] = []

    def note(env: HouseholdEnv) -> None:
        states.append(state_hash(env))
        on_step(env)

    episode = rollout(env, policy, seed, task, note, policy_seed)
    actions = tuple(tuple(chosen[robot] for robot in env.possible_agents) for chosen in episode.actions)
    home = home_hash(episode.task.home)
    rewards = tuple(episode.rewards.tolist())
    said = tuple(tuple(words.values()) for words in episode.said if words)
    return EpisodeFile(episode.task, name, seed, options, actions, rewards, tuple(states), episode.success, home, said)


def plain_options(env: HouseholdEnv) -> dict[str, Any]:
    """Return what an environment was made with, as plain data, as episode files hold it.

    Raises:
        OptionError: the environment was given objects.
    """
    given = env.options
    options = {option: getattr(given, option) for option in _OPTIONS} | {"observation": given.observation_name}
    robots = tuple(str(robot) if isinstance(robot, Path) else robot for robot in given.robots)
    catalog = None if given.catalog is None else str(given.catalog)
    others = {name: getattr(given, name) for name in _DEFAULTS} | {"robots": robots, "catalog": catalog}
    names = (*options.values(), *robots, given.task)
    if ":" in options["observation"] or not all(isinstance(name, str | int) for name in names):
        raise OptionError(
            "episode files hold names of sensors, channels, advisers, robots and tasks, no objects; record those "
            "yourself"
        )
    return options | {name: value for name, value in others.items() if value != _DEFAULTS[name]}


def replay_episode(file: EpisodeFile) -> str | None:
    """Play an episode file again.

    Returns:
        None if every state and reward is the same, else a sentence that says what differs first.
    """
    if home_hash(file.task.home) != file.home_sha256:
        return f"the home {file.task.home} is not the one that the episode was played in"
    env = HouseholdEnv(home=file.task.home, **file.options)
    try:
        again = record_episode(env, ReplayPolicy(file.actions, env, file.said), file.policy, file.seed, file.task)
        return _first_difference(file, again, env.action_names)
    finally:
        env.close()


def _first_difference(file: EpisodeFile, again: EpisodeFile, names: dict[str, tuple[str, ...]]) -> str | None:
    if file.states[0] != again.states[0]:
        return "the state differs at the start, before any action"
    for step, numbers in enumerate(file.actions, start=1):
        doing = ", ".join(f"{robot} {names[robot][number]}" for robot, number in zip(names, numbers, strict=True))
        if step >= len(again.states):
            return f"the episode ends after step {step - 1} of {len(file.actions)}"
        if file.states[step] != again.states[step]:
            return f"the state differs after step {step} ({doing})"
        if file.rewards[step - 1] != again.rewards[step - 1]:
            return f"the reward of step {step} differs ({doing})"
    if len(again.actions) > len(file.actions) or again.success != file.success:
        return f"the episode does not end in the same way after step {len(file.actions)}"
    return None


def save_episode(file: EpisodeFile, path: Path | str) -> None:
    """Write an episode file, one line for each part, whole or not at all."""
    parts = {name: part for name, part in asdict(file).items() if name != "said" or part}
    order = ("format", "library", *(name for name in parts if name not in ("format", "library")))
    lines = ",\n".join(f"{json.dumps(name)}: {json.dumps(parts[name])}" for name in order)
    write_atomically(Path(path), f"{{\n{lines}\n}}\n")


def load_episode(path: Path | str) -> EpisodeFile:
    """Read an episode file; files that it names are looked for where it was saved, then beside it.

    Raises:
        ResultError: the file is missing, damaged, or of another kind.
    """
    try:
        return _located(_parse(read_object(path)), Path(path).parent)
    except FileNotFoundError as error:
        raise ResultError(f"{path}: no such file; `chmarl-pb episode save` writes episodes") from error
    except WRONG as error:
        raise ResultError(f"{path}: not a whole episode file: {str(error)[:300]}; save the episode again") from error


def _located(file: EpisodeFile, folder: Path) -> EpisodeFile:
    """Return an episode whose home, catalogue and robots are those in a folder, where paths lead to nothing."""

    def found(name: str) -> str:
        beside = folder / name
        return str(beside) if Path(name).suffix and not Path(name).is_file() and beside.is_file() else name

    options = dict(file.options)
    if options.get("catalog"):
        options["catalog"] = found(options["catalog"])
    if "robots" in options:
        options["robots"] = tuple(map(found, options["robots"]))
    return replace(file, task=replace(file.task, home=found(file.task.home)), options=options)


def _parse(data: dict[str, Any]) -> EpisodeFile:
    """Return the episode of a file's content, or raise an error if its parts do not fit each other."""
    if data.get("format") != FORMAT:
        raise ValueError(f"its format is {data.get('format')!r}, not {FORMAT!r}")
    file = plain(EpisodeFile(**data), policy=str, options=dict, success=bool, home_sha256=str, library=str)
    file = replace(
        file,
        task=task_of(data["task"]),
        options={name: tuple(value) if name == "robots" else value for name, value in data["options"].items()},
        actions=tuple(tuple(map(int, numbers)) for numbers in file.actions),
        rewards=tuple(map(float, file.rewards)),
        states=tuple(map(str, file.states)),
        said=tuple(tuple(map(int, symbols)) for symbols in file.said),
    )
    steps = len(file.actions)
    if len(file.states) != steps + 1 or len(file.rewards) != steps:
        raise ValueError(f"{steps} actions, {len(file.rewards)} rewards and {len(file.states)} states do not fit")
    robots = file.options.get("robots", TEAM)
    if file.said and len(file.said) != steps:
        raise ValueError(f"{steps} actions and {len(file.said)} rows of symbols do not fit")
    if any(len(numbers) != len(robots) for numbers in (*file.actions, *file.said)):
        raise ValueError(f"an action is not {len(robots)} numbers")
    if not (file.seed is None or (isinstance(file.seed, int) and file.seed >= 0)):
        raise ValueError(f"its seed {file.seed!r} is not a whole number from 0 on")
    if set(file.options) - set(_DEFAULTS) != set(_OPTIONS):
        raise ValueError(f"its options are {sorted(file.options)}, not {sorted(_OPTIONS)}")
    return file
