"""What a policy has to be given again as it was in training."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chmarl_pb.catalog import ROOM_KINDS
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import PAPER
from chmarl_pb.learning.benchmark_env import held_by, meaning_in, meaning_of
from chmarl_pb.learning.config import CATALOG, HOME, MEANING, OWN, ROOMS, RULES, TRAINED_IN
from chmarl_pb.learning.storage.checkpoint import CheckpointError

_PART = re.compile(r"'([^']+)': (\w+\(.*?\))(?=, '|\)$)")  # of the text of a Dict space
_LONGEST = 100  # characters of a space in a message
_A_SENSOR = "a sensor of your own"


def check_size(env: HouseholdEnv, setting: Mapping[str, Any], path: Path) -> None:
    """Check that pictures are as large as in training; frozen features of others have the same shape.

    Args:
        env: environment to act in.
        setting: of the training.
        path: of the checkpoint, for the error.

    Raises:
        CheckpointError: they are not.
    """
    own = env.options.image_size
    if env.options.observation == "visual" and (wanted := setting.get("image_size", own)) != own:
        raise CheckpointError(
            f"{path}: was trained with pictures of {wanted} pixels, not {own}; give image_size={wanted}"
        )


def image_size_of(setting: Mapping[str, Any]) -> dict[str, int]:
    """Return the option ``image_size`` of a training, if it is not the usual one."""
    size = setting.get("image_size", Options().image_size)
    return {} if size == Options().image_size else {"image_size": size}


def differences(theirs: Mapping[str, str], own: Mapping[str, str]) -> str:
    """Return how the spaces of a training differ from those of an environment, in words.

    Args:
        theirs: robot -> its space, as text.
        own: the same of the environment.
    """
    if theirs.keys() != own.keys():
        return f"of the robots {', '.join(theirs)}, not {', '.join(own)}"
    robot = next(robot for robot in own if theirs[robot] != own[robot])
    was, now = (dict(_PART.findall(space)) for space in (theirs[robot], own[robot]))
    if was == now:
        return f"the {robot} had {theirs[robot][:_LONGEST]}, not {own[robot][:_LONGEST]}"
    told = [f"with {', '.join(names)}" for names in [sorted(was.keys() - now.keys())] if names]
    told += [f"without {', '.join(names)}" for names in [sorted(now.keys() - was.keys())] if names]
    same = sorted(key for key in was.keys() & now.keys() if was[key] != now[key])
    told += [f"with {key} {was[key]}, not {now[key]}" for key in same[:3]]
    mend = "give the options of its training, as --observation, or, of own parts, evaluate's --env"
    return f"those of the {robot} {'; '.join(told)}; {mend}"


def check_names(env: HouseholdEnv, setting: Mapping[str, Any], path: Path) -> None:
    """Check that the classes of things, and the rooms that robots go to and tell of, are those of the training.

    Ids, words, actions and messages would mean others. Older checkpoints of one home do not tell its rooms.

    Raises:
        CheckpointError: they are not.
    """
    if setting.get(CATALOG, "") != env.catalog.content:
        wanted = "the catalogue file that it was trained with" if setting.get(CATALOG) else "no catalog"
        raise CheckpointError(f"{path}: was trained with other classes of things; give {wanted}")
    own = ",".join(env.rooms)
    rooms = setting.get(ROOMS) or (own if setting.get(HOME) else ",".join(ROOM_KINDS))
    if rooms != own:
        raise CheckpointError(
            f"{path}: was trained where actions and messages name the rooms {rooms}, not {own}; play it in such a home"
        )


def check_rules(env: HouseholdEnv, setting: Mapping[str, Any], path: Path) -> None:
    """Check that actions and observations mean what they did in training; wording and time limit may be others.

    Args:
        env: environment to act in.
        setting: of the training.
        path: of the checkpoint, for the error.

    Raises:
        CheckpointError: they do not.
    """
    theirs, own = meaning_in(setting), meaning_of(env.options)
    if theirs != own:
        rules = {"track": PAPER, **setting.get(RULES, {})}
        rules |= {"messages": setting["messages"]} if setting.get(MEANING) else {}
        told = ", ".join(f"{name}={value!r}" for name, value in rules.items())
        differ = ", ".join(name for name in own if own[name] != theirs[name])
        raise CheckpointError(f"{path}: was trained by other rules ({differ}); make the environment with {told}")


def lacking_own_parts(options: Options, setting: Mapping[str, Any], path: Path) -> str:
    """Return which objects of the user's own a policy was trained with that an environment lacks, as a sentence.

    No file holds these. It is empty if there are none.

    Args:
        options: of the environment.
        setting: of the training.
        path: of the checkpoint.
    """
    lacking = [f"{name}={one}" for name, one in _own_parts(setting).items() if not _has(options, name, one)]
    if not lacking:
        return ""
    return (
        f"{path}: was trained with {' and '.join(lacking)}, and this environment has other parts in their place; give "
        "it objects of these classes, unless others are meant"
    )


def _own_parts(setting: Mapping[str, Any]) -> dict[str, str]:
    """Return option -> class of the object that it was in training; classes of sensors are not kept."""
    trained = setting.get(TRAINED_IN, {})
    told = {name: setting.get(name) for name in ("messages", "feedback")} | {"task": trained.get("task")}
    parts = {name: one.partition("(")[0] for name, one in told.items() if isinstance(one, str) and ":" in one}
    return parts | ({"observation": _A_SENSOR} if held_by("observation") in trained.get(OWN, {}) else {})


def _has(options: Options, name: str, of_class: str) -> bool:
    """Return whether an option is an object of this class."""
    if of_class == _A_SENSOR:
        return name in options.own()
    return str(options.recorded().get(name)).partition("(")[0] == of_class


def silenced(setting: dict[str, Any]) -> tuple[str, ...]:
    """Return the keys that read as zeros in training: ``messages`` and ``feedback``, where they were off."""
    return tuple(key for key in ("messages", "feedback") if not setting.get(key, True))
