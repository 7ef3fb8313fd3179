"""Options of trainings that a run would not use: they are refused, where silence would tell a wrong story."""

from collections.abc import Callable, Mapping
from typing import Any

from chmarl_pb.tasks.splits import STREAM

#: Algorithm -> settings of its class that it does not use; those of other algorithms are not in its class.
_OF_OTHERS: Mapping[str, frozenset[str]] = {
    "iql": frozenset({"embedding", "joint_units", "standardize_state"}),
    "vdn": frozenset({"embedding", "joint_units", "standardize_state"}),
    "qmix": frozenset({"joint_units"}),
    "qtran": frozenset({"embedding"}),
    "imitation": frozenset({"reward_scale"}),
}
_OF_PICTURES = frozenset({"image_encoder", "image_size"})
_UNPOOLED = frozenset({"cnn", "resnet18", "efficientnet-lite0"})
_GROUNDED = ("grounded", "parsed")  # pools that read detections in another way
_OF_ENCODERS = frozenset({"features", "graph_pool", "word_vectors", "image_size"})


def refuse_idle(given: Any, default: Any, why_idle: Callable[[str], str], prefix: str = "") -> None:
    """Refuse a setting that is not at its default, and that the run would not use.

    Args:
        given: settings, a dataclass.
        default: of the same class.
        why_idle: tells of a setting's name why it would not be used; "" if it would be.
        prefix: of the options' names.

    Raises:
        ValueError: there is one.
    """
    changed = (name for name, value in vars(given).items() if value != getattr(default, name))
    for name in sorted(changed):
        if why := why_idle(name):
            raise ValueError(f"--{prefix}{name.replace('_', '-')}: {why}; leave it out")


def idle_in_train(name: str, algorithm: str, config: Any, setting: Any) -> str:
    """Return why ``chmarl-pb train`` would not use a setting; "" if it would.

    Args:
        name: of the setting.
        algorithm: that is trained.
        config: its settings.
        setting: what tells what robots observe: the environment's settings, or those of clones themselves.
    """
    if name in _OF_OTHERS.get(algorithm, ()):
        return f"{algorithm} does not use it"
    if name == "embedding" and algorithm == "pqn" and config.mixer in ("iql", "vdn"):
        return f"the mixer {config.mixer} has no layers"
    if name == "split" and getattr(setting, "home", None):
        return "--home is trained in instead"
    if name == "home_rollouts" and (setting.home or setting.options.split != STREAM):
        return "only with --split generated is there another home to go to"
    if name == "critic_starts" and algorithm == "mappo" and not config.start:
        return "actors wait for the critic only where --start begins with trained ones"
    return _idle_in_encoder(name, config, setting.observation)


def idle_in_sb3(name: str, config: Any) -> str:
    """Return why ``chmarl-pb sb3`` would not use a setting; "" if it would."""
    if name in _OF_ENCODERS and config.keys:
        return f"preset {config.preset!r} reads a few numbers, and nothing is encoded"
    if name == "feedback" and config.keys:
        return f"preset {config.preset!r} reads none, nor does the policy of a drone that does not learn"
    return _idle_in_encoder(name, config, config.observation)


def _idle_in_encoder(name: str, config: Any, observation: str) -> str:
    pictures = observation == "visual"
    if name in _OF_PICTURES and not pictures:
        return f"there are no pictures with --observation {observation}"
    if name != "graph_pool" or not pictures or getattr(config, "encoder", "household") != "household":
        return ""
    if config.image_encoder in _UNPOOLED:
        return f"features of {config.image_encoder} are not pooled as scene graphs and detections are"
    if config.image_encoder == "detector" and config.graph_pool not in _GROUNDED:
        return f"detections are pooled by {' and '.join(_GROUNDED)} in a way of their own, and alike by all others"
    return ""
