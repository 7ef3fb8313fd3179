"""The benchmark as a learner meets it: how its environment is made, and what a checkpoint has to know of that."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Literal

import chmarl_pb
from chmarl_pb.catalog import ROOM_KINDS
from chmarl_pb.envs.options import Options
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.tracks import OF_TRACK, PAPER, TRACKS
from chmarl_pb.evaluation.provenance import robots_hash
from chmarl_pb.fingerprint import fingerprint
from chmarl_pb.homes.home import load_home
from chmarl_pb.learning.config import CATALOG, FROZEN, HOME, MEANING, OWN, ROOMS, RULES, TRAINED_IN
from chmarl_pb.learning.lookup import look_up
from chmarl_pb.learning.networks.frozen import FROZEN_ENCODERS, FrozenEncoder, frozen_encoder
from chmarl_pb.learning.networks.images import IMAGE_ENCODERS
from chmarl_pb.learning.networks.kept_features import FeatureEnv
from chmarl_pb.learning.observation_keys import GOAL
from chmarl_pb.rendering.renderer import VISIBILITY_SIZE
from chmarl_pb.tasks.symbols import Talk

ObservationName = Literal["scene_graph", "visual"]

#: Options that change what is learned, but neither what is observed nor how weights are played.
_TRAINED_IN = ("split", "task", "execution", "robots")


def benchmark(
    observation: str,
    messages: Any = OF_TRACK,
    feedback: Any = OF_TRACK,
    image_encoder: str = "resnet18",
    image_size: int = VISIBILITY_SIZE,
    **options: Any,
) -> tuple[Callable[[], Any], dict[str, Any]]:
    """Return what makes the ParallelEnv of the training tasks, and the setting of policies that are trained in it.

    Args:
        observation: "scene_graph" or "visual".
        messages: whether the robots hear each other, and how; as the track has it if it is not given.
        feedback: whether they get language feedback, likewise.
        image_encoder: of pictures; if it is frozen, the environment gives its features in their place.
        image_size: of pictures, in pixels.
        options: more options of the environment, its track among them.

    Raises:
        ValueError: there is no such encoder.
        CheckpointError: there are no weights of a frozen encoder, and pictures need them.
    """
    look_up("image_encoder", image_encoder, {**IMAGE_ENCODERS, **FROZEN_ENCODERS})
    frozen = frozen_encoder(image_encoder) if observation == "visual" and image_encoder in FROZEN_ENCODERS else None
    given = {"messages": messages, "feedback": feedback, "image_size": image_size, **options}
    env_fn = partial(_environment, frozen, observation, **given)
    return env_fn, _setting(Options(observation, **given), frozen)


def setting_of(env: Any) -> dict[str, Any]:
    """Return the setting of policies that are trained in an environment; nothing of one that is not the benchmark's."""
    core = getattr(env, "unwrapped", None)
    if not isinstance(core, HouseholdEnv):
        return {}
    return _setting(core.options, env.encoder if isinstance(env, FeatureEnv) else None)


def _setting(options: Options, frozen: FrozenEncoder | None) -> dict[str, Any]:
    """Return what a policy has to know of the environment that it was trained in, and of what encodes its pictures."""
    recorded = options.recorded()
    shared = {name: recorded[name] for name in ("messages", "feedback", "image_size")}
    known = options.things.content
    own: dict[str, Any] = {CATALOG: known} if known else {}  # as in checkpoints from before there was a choice
    own |= {GOAL: True} if options.goal else {}
    own |= {HOME: str(options.home)} if options.home else {}
    own |= {ROOMS: rooms} if (rooms := other_rooms(options)) else {}
    own |= {RULES: rules} if (rules := recorded_rules(options)) else {}
    own |= {MEANING: meaning} if (meaning := meaning_of(options)) != meaning_in(own) else {}
    own |= {TRAINED_IN: trained_in(options)}
    return {**shared, FROZEN: frozen.fingerprint if frozen else "", **own}


def untold(theirs: Mapping[str, Any], own: Mapping[str, Any]) -> dict[str, Any]:
    """Return what the setting of an older training does not tell, as it is in the present one.

    That is in what it was trained, and, in one home, the rooms there.
    """
    return {name: own[name] for name in (TRAINED_IN, *[ROOMS] * (HOME in theirs)) if name in own}


def other_rooms(options: Options) -> str:
    """Return the rooms that actions and messages name, with a comma between; nothing for those of the benchmark."""
    if options.home is None:
        return ""
    rooms = load_home(options.home, options.things).goto_rooms
    return "" if rooms == ROOM_KINDS else ",".join(rooms)


def trained_in(options: Options) -> dict[str, Any]:
    """Return what a run has to go on with: the split and the like, what its files hold, and the user's own objects."""
    recorded = options.recorded()
    files: dict[str, Any] = {}
    if options.home is not None:
        files["home_sha256"] = load_home(options.home, options.things).content
    if "robots" in recorded:
        files["robots_sha256"] = robots_hash(options.models.values())
    if own := options.own():  # what they hold; their code may be mended in the course of a run
        files[OWN] = {held_by(name): fingerprint(one, code=False) or "unknown" for name, one in own.items()}
    return {name: recorded[name] for name in _TRAINED_IN if name in recorded} | files


def held_by(option: str) -> str:
    """Return the key under which a setting has the hash of what the user's own objects in an option hold."""
    return f"what {option} holds"


def recorded_rules(options: Options) -> dict[str, Any]:
    """Return the options by which a policy plays as it was trained: the track, and what differs from it.

    By the paper's rules whether there are messages and feedback is none of them: without, they read as zeros. Nor are
    objects of the user's own, which a checkpoint does not hold.
    """
    track, usual = options.track, TRACKS[options.track]
    own = {name: getattr(options, name) for name in usual if name != "split"}
    differs = {
        name: value for name, value in own.items()
        if value != usual[name] and isinstance(value, bool | int | str)
        and not (track == PAPER and isinstance(value, bool) and isinstance(usual[name], bool) and usual[name])
    }  # fmt: skip
    return ({"track": track} if track != PAPER else {}) | differs


def meaning_of(options: Options) -> dict[str, bool]:
    """Return the rules by which actions and observations mean what they do; not the wording, nor the time limit."""
    return {
        "pointing": options.pointing, "lookalikes": options.lookalikes, "own words": isinstance(options.channel, Talk)
    }  # fmt: skip


def meaning_in(setting: Mapping[str, Any]) -> dict[str, bool]:
    """Return the same of the setting of a training."""
    told: dict[str, bool] = setting.get(MEANING) or meaning_of(Options(**setting.get(RULES, {})))
    return told


def _environment(frozen: FrozenEncoder | None, observation: str, **options: Any) -> Any:
    env = chmarl_pb.parallel_env(observation, **options)
    return FeatureEnv(env, frozen) if frozen else env
