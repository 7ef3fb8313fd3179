"""How the runs of a row were made, in the words of the page: encoder, teacher, length of the training, seeds."""

from collections.abc import Sequence
from typing import Any

from chmarl_pb.envs.joint import PARTNERS
from chmarl_pb.envs.registration import options_of
from chmarl_pb.learning.config import FROZEN
from chmarl_pb.learning.storage.checkpoint import RENAMED
from training.tables.cells import NOT_RUN
from training.tables.lessons import TEACHER
from training.tables.record import Record
from training.tables.row import Row

POOL = "mean"  # of graphs, in runs from before this was a setting
#: What learners did before they had these settings.
_BEFORE = {
    "graph_pool": POOL, "word_vectors": False, "numbers_past": False, "cells_past": False, "history_past": False,
    "looks_past": False, "greedy_share": 0.0,
    "grounding_coef": 0.0, "home_rollouts": 100, "anneal": 0.0, "split": "train", "preset": "encoder",
    "robots": "humanoid,drone", "catalog_sha256": "", "encoder": "household", "mixer": "", "tau": 1.0, "td_lambda": 0.0,
    "layer_norm": False, "normalize_values": False, "standardize_state": False, "standardize_rewards": False,
    "workers": 1, "overlap": False, "rooms": "",
}  # fmt: skip


def made_with(row: Row, same: Sequence[Record]) -> str:
    """Return what encodes a row's observations, its teacher, the length of its training, and its feedback at test."""
    if not same:
        return ""
    checkpoint = same[0]["checkpoint"]
    config = checkpoint.get("config", {})
    encoder = _read(same[0]["observation"], config)
    begun, imitated = checkpoint.get("begun_with", {}), config.get("expert", "")
    if begun.get("algorithm") == "imitation":
        imitated = begun.get("config", {}).get("expert", TEACHER)
    if checkpoint.get("kind") == "bc":
        imitated = "planner"
    teacher = f"teacher: {imitated}" if imitated else ""
    told = f"{'' if row.feedback else 'no '}feedback at test"
    return ", ".join(filter(None, [encoder, *_beside(config), teacher, budget(same[0]), minutes(same), told]))


def _read(observation: str, config: dict[str, Any]) -> str:
    """Return what a network reads of the observations."""
    if config.get("preset") == "goal":
        return "numbers alone, goal observed"
    graphs, pictures = f"{config.get('graph_pool', POOL)} pool", str(config.get("image_encoder", ""))
    encoder = graphs if observation == "scene_graph" else pictures
    return f"{encoder} and numbers, goal observed" if config.get("preset") == "goal-encoder" else encoder


def _beside(config: dict[str, Any]) -> list[str]:
    """Return what drives the drone, if a model of Stable-Baselines3 drives the humanoid alone."""
    options = options_of(config["env_id"]) if "Humanoid" in config.get("env_id", "") else {}
    return [f"drone: {options.get('partner', PARTNERS[0])}"] if options else []


def minutes(same: Sequence[Record]) -> str:
    """Return how long trainings took by the clock, e.g. "16 to 19 min"."""
    known = sorted({round(record["seconds"]["train"] / 60) for record in same if "train" in record.get("seconds", {})})
    begun = " (after that of the weights it begins with)" * ("--start" in same[0].get("commands", {}).get("train", ""))
    return f"{' to '.join(str(known[end]) for end in (0, -1)[: len(known)])} min{begun}" if known else ""


def seeds(row: Row, same: Sequence[Record]) -> str:
    """Return how many seeds a row has, and how many it is to have if some are missing."""
    if not same:
        return NOT_RUN
    missing = f" of {row.seeds}" if len(same) < row.seeds else ""
    settings = [_settings(record) for record in same]
    return f"{len(same)}{missing}{'' if all(one == settings[0] for one in settings) else ' (settings differ)'}"


def _settings(record: Record) -> dict[str, object]:
    """Return the settings that all seeds of a row should share: not the files of a run, nor what it does not use."""
    own = {"seed", "start"} | ({"image_encoder"} if record["observation"] == "scene_graph" else set())
    checkpoint = record["checkpoint"]
    config = {RENAMED.get(name, name): value for name, value in checkpoint.get("config", {}).items()}
    settings = {**_BEFORE, **config, FROZEN: checkpoint.get(FROZEN, "")}
    return {name: value for name, value in settings.items() if name not in own and value is not None}


def budget(record: Record) -> str:
    """Return the length of the training, e.g. "3,000 + 12,000 episodes"."""
    unit, checkpoint = record["curve"]["unit"], record["checkpoint"]
    configs = [checkpoint.get("begun_with", {}).get("config", {}), checkpoint.get("config", {})]
    parts = [f"{config[unit]:,}" for config in configs if unit in config]
    return f"{' + '.join(parts)} {unit}" if parts else ""


def encoder_of(record: Record) -> str:
    """Return what encodes the observations of a run."""
    config = record["checkpoint"].get("config", {})
    if config.get("preset") == "goal":
        return _read(record["observation"], config)
    if record["observation"] == "scene_graph":
        pool = config.get("graph_pool", POOL)
        return "graph convolution" if pool == POOL else f"graph convolution, {pool}"
    weights = record["checkpoint"].get(FROZEN, "")
    encoder = config.get("image_encoder", "")
    return f"{encoder}, frozen, weights {weights[:8]}" if weights else f"{encoder}, trained end to end"
