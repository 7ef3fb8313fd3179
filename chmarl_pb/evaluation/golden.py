"""Rollouts with known digests: they tell whether this machine gives, bit by bit, the results that others get.

Results depend on more than seeds: a library that rounds differently, or a processor with other instructions, can change
the last bits of a picture or of a driven motion. ``chmarl-pb doctor`` plays these rollouts and names those that differ.
"""

import hashlib
import json
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import MultiDiscrete

from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.envs.vector.env import vector_env
from chmarl_pb.errors import OptionError
from chmarl_pb.evaluation.json_file import WRONG, read_object
from chmarl_pb.evaluation.provenance import machine, versions
from chmarl_pb.files import write_atomically
from chmarl_pb.policies.registry import make_policy

#: Digests of the rollouts, and where they were recorded.
RECORDED = Path(__file__).with_name("golden.json")

_STEPS = 40


def digest(*values: Any) -> str:
    """Return the sha256 of nested dicts, arrays and plain values, bit by bit."""
    found = hashlib.sha256()

    def add(value: Any) -> None:
        if isinstance(value, dict):
            for key in sorted(value):
                found.update(key.encode())
                add(value[key])
        elif isinstance(value, np.ndarray) and value.dtype != object:
            found.update(str((value.dtype, value.shape)).encode() + value.tobytes())
        elif isinstance(value, np.ndarray | list | tuple):
            for part in value:
                add(part)
        else:
            found.update(repr(value).encode())

    add(values)
    return found.hexdigest()


def _played(policy: str, **options: Any) -> str:
    """Let a built-in policy play, all from seed 0; return the digest of all that comes back, and of driven motions."""
    env = HouseholdEnv(**options)
    try:
        driver, results = make_policy(policy, env), list[Any]()
        for _ in range(_STEPS):
            if not env.agents:
                observations, infos = env.reset(seed=None if results else 0)
                driver.reset(0)
                results.append((observations, infos))
            observations, *outcome, infos = env.step(driver.act(observations, infos))
            motion = [(snapshot.bases, snapshot.joints, snapshot.items) for snapshot in env.snapshots]
            results.append((observations, outcome, infos, motion))
        return digest(*results)
    finally:
        env.close()


def _side_by_side(**options: Any) -> str:
    envs = vector_env(4, workers=2, **options)
    try:
        rng, space = np.random.default_rng(0), envs.single_action_space
        assert isinstance(space, MultiDiscrete)
        results: list[Any] = [envs.reset(seed=0)[0]]
        for _ in range(_STEPS):
            actions = rng.integers(space.nvec, size=(envs.num_envs, len(space.nvec)))
            observations, rewards, terminated, truncated, _ = envs.step(actions)
            results.append((observations, rewards, terminated, truncated))
        return digest(*results)
    finally:
        envs.close()


#: What is played -> how its digest is found.
ROLLOUTS: dict[str, Callable[[], str]] = {
    "graphs": partial(_played, "random", split="train"),
    "pictures": partial(_played, "random", observation="visual", split="val-unseen"),
    "depth, segmentation and text": partial(
        _played, "random", observation=("depth", "segmentation", "text"), split="val-seen"
    ),
    "planner's feedback": partial(_played, "random", feedback="planner", split="train"),
    "grounded, graphs": partial(_played, "random", track="grounded", split="generated-val"),
    "grounded, pictures": partial(_played, "random", track="grounded", observation="visual", split="generated-val"),
    "vector of 4 in 2 processes": partial(_side_by_side, observation="visual", split="train"),
    "simulated execution": partial(_played, "planner", execution="simulated", split="train"),
}


def digests() -> Iterator[tuple[str, str]]:
    """Play all rollouts one after the other, and yield what was played and its digest."""
    for name, play in ROLLOUTS.items():
        yield name, play()


def record(path: Path, found: dict[str, str]) -> None:
    """Write digests to a file, with versions and machine."""
    text = json.dumps({"versions": versions(), "machine": machine(), "digests": found}, indent=1)
    write_atomically(path, text + "\n")


def recorded(path: Path = RECORDED) -> dict[str, dict[str, Any]]:
    """Return "versions", "machine" and "digests" of a file that ``record`` wrote.

    Raises:
        OptionError: it is no such file.
    """
    try:
        data = read_object(path)
        parts = {name: data[name] for name in ("versions", "machine", "digests")}
        if wrong := [name for name, part in parts.items() if not isinstance(part, dict)]:
            raise ValueError(f"its {wrong[0]} is no object")
        if not parts["digests"] or not all(isinstance(digest, str) for digest in parts["digests"].values()):
            raise ValueError("its digests are no texts")
        return parts
    except (OSError, *WRONG) as error:
        raise OptionError(
            f"{path}: no digests of rollouts ({error}); write them by `chmarl-pb doctor --record {path}`"
        ) from error
