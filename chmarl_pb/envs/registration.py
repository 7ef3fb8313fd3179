"""The Gymnasium ids, registered when the package is imported."""

from typing import Any

import gymnasium

from chmarl_pb.envs.tracks import GROUNDED, PAPER, TRACKS
from chmarl_pb.errors import OptionError

_GRAPHS, _PICTURES = {"observation": "scene_graph"}, {"observation": "visual"}
_WITH_BELIEF = {"partner": "belief"}  # the search policy is that of the older ids

#: Id -> how it is made (data sets name these functions), track, keyword arguments.
_IDS: dict[str, tuple[str, str, dict[str, Any]]] = {
    "CHMARL/SceneGraph-v0": ("joint", PAPER, _GRAPHS),
    "CHMARL/Visual-v0": ("joint", PAPER, _PICTURES),
    "CHMARL/SceneGraphHumanoid-v0": ("humanoid", PAPER, _GRAPHS),
    "CHMARL/VisualHumanoid-v0": ("humanoid", PAPER, _PICTURES),
    "CHMARL/SceneGraphHumanoid-v1": ("humanoid", PAPER, _GRAPHS | _WITH_BELIEF),
    "CHMARL/VisualHumanoid-v1": ("humanoid", PAPER, _PICTURES | _WITH_BELIEF),
    "CHMARL/GroundedSceneGraph-v0": ("grounded_joint", GROUNDED, _GRAPHS),
    "CHMARL/GroundedVisual-v0": ("grounded_joint", GROUNDED, _PICTURES),
    "CHMARL/GroundedSceneGraphHumanoid-v0": ("grounded_humanoid", GROUNDED, _GRAPHS | _WITH_BELIEF),
    "CHMARL/GroundedVisualHumanoid-v0": ("grounded_humanoid", GROUNDED, _PICTURES | _WITH_BELIEF),
}
ENV_IDS = tuple(_IDS)


def register_envs() -> None:
    """Register the ids; registering again changes nothing."""
    for env_id, (kind, track, options) in _IDS.items():
        if env_id not in gymnasium.registry:
            gymnasium.register(
                env_id,
                f"chmarl_pb.envs.joint:make_{kind}",
                max_episode_steps=TRACKS[track]["max_steps"],
                kwargs=options,
                vector_entry_point=f"chmarl_pb.envs.vector.env:{kind}_vector_env",
            )


def options_of(env_id: str) -> dict[str, Any]:
    """Return the keyword arguments that an id is registered with, its track among them.

    Raises:
        OptionError: it is no id of the benchmark.
    """
    if env_id not in _IDS:
        raise OptionError(f"{env_id!r} is no id of the benchmark; use one of: {', '.join(_IDS)}")
    _, track, options = _IDS[env_id]
    return {"track": track, **options}


def id_of(kind: str, options: dict[str, Any]) -> str:
    """Return the id that is made in this way, whose registered keyword arguments are most alike to these."""
    own = {name: given for name, (made, _, given) in _IDS.items() if made == kind and given.keys() <= options.keys()}
    return max(own, key=lambda name: sum(options[key] == value for key, value in own[name].items()))
