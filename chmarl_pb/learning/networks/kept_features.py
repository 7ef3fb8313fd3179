"""Frozen features of pictures: computed once for a data set and kept beside it, or step by step in an environment.

Both ways give the same features, bit by bit: a policy that has learned from kept features sees the same when it acts.
"""

import hashlib
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo.utils.wrappers import BaseParallelWrapper
from rich.progress import Progress

from chmarl_pb.errors import DatasetError
from chmarl_pb.files import Lock, write_atomically, writing
from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.observation_keys import IMAGE, named
from chmarl_pb.learning.storage import seal
from chmarl_pb.progress import run_bar

if TYPE_CHECKING:
    from chmarl_pb.data.read import Dataset  # needs Minari

#: What an environment's ``reset`` and ``step`` return.
Reset = tuple[dict[str, Any], dict[str, Any]]
Step = tuple[dict[str, Any], dict[str, Any], dict[str, Any], dict[str, Any], dict[str, Any]]


def feature_space(space: spaces.Dict, encoder: FrozenEncoder) -> spaces.Dict:
    """Return an observation space with an encoder's features, float16, in the place of each picture."""
    features = spaces.Box(-np.inf, np.inf, encoder.shape, np.float16)
    return spaces.Dict({**space.spaces, **dict.fromkeys(named(space.spaces, IMAGE), features)})


def with_features(observations: dict[Any, dict[str, Any]], encoder: FrozenEncoder) -> dict[Any, dict[str, Any]]:
    """Return agents' observations with features in the place of their pictures, computed together."""
    places = [(name, key) for name, seen in observations.items() for key in named(seen, IMAGE)]
    if not places:
        return observations
    pictures = np.stack([observations[name][key] for name, key in places])
    changed = {name: dict(seen) for name, seen in observations.items()}
    for (name, key), features in zip(places, encoder(torch.from_numpy(pictures)).numpy(), strict=True):
        changed[name][key] = features
    return changed


def all_with_features(seen: Sequence[dict[str, Any]], encoder: FrozenEncoder) -> list[dict[str, Any]]:
    """Return several environments' observations with features in the place of all their pictures, computed together."""
    parts = {(number, name): part for number, agents in enumerate(seen) for name, part in agents.items()}
    changed = with_features(parts, encoder)
    return [{name: changed[number, name] for name in agents} for number, agents in enumerate(seen)]


class FeatureEnv(BaseParallelWrapper):  # type: ignore[misc]
    """A ParallelEnv whose agents observe features in the place of pictures; all else is that of the inner one."""

    def __init__(self, env: Any, encoder: FrozenEncoder):
        """Wrap an environment with Dict observations.

        Args:
            env: the inner environment.
            encoder: computes the features.
        """
        super().__init__(env)
        self.encoder = encoder
        self._spaces = {name: feature_space(env.observation_space(name), encoder) for name in env.possible_agents}

    def observation_space(self, agent: str) -> spaces.Dict:
        """Return an agent's observation space."""
        return self._spaces[agent]

    def reset(self, seed: int | None = None, options: dict[str, Any] | None = None) -> Reset:
        """Start an episode; see the inner environment."""
        observations, infos = self.env.reset(seed=seed, options=options)
        return with_features(observations, self.encoder), infos

    def step(self, actions: dict[str, Any]) -> Step:
        """Let all agents act once; see the inner environment."""
        observations, *rest = self.env.step(actions)
        return with_features(observations, self.encoder), *rest


def reset_all(
    envs: Sequence[Any], seeds: Sequence[int | None], options: Sequence[dict[str, Any] | None]
) -> list[Reset]:
    """Reset environments of one kind; the pictures of all :class:`FeatureEnv` are encoded together."""
    wanted = zip(envs, seeds, options, strict=True)
    return _together(envs, [_inner(env).reset(seed=seed, options=option) for env, seed, option in wanted])


def step_all(envs: Sequence[Any], actions: Sequence[dict[str, Any]]) -> list[Step]:
    """Step environments of one kind; the pictures of all :class:`FeatureEnv` are encoded together."""
    return _together(envs, [_inner(env).step(action) for env, action in zip(envs, actions, strict=True)])


def _inner(env: Any) -> Any:
    return env.env if isinstance(env, FeatureEnv) else env


def _together(envs: Sequence[Any], results: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    if not envs or not isinstance(envs[0], FeatureEnv):
        return results
    seen = all_with_features([result[0] for result in results], envs[0].encoder)
    return [(observations, *result[1:]) for observations, result in zip(seen, results, strict=True)]


def kept_features(dataset: "Dataset", encoder: FrozenEncoder, quiet: bool = False) -> dict[str, NDArray[np.float16]]:
    """Return the features of every state in which the robots of a data set act, from a file beside the data set.

    The file is made at the first call, episode by episode: an interrupted call goes on where it was, and of several
    processes one makes it while the others wait. Its name has a hash of the weights and of the data set, its end one of
    its contents.

    Args:
        dataset: with pictures.
        encoder: computes the features.
        quiet: whether no progress is shown.

    Returns:
        Key of a picture -> (all steps, *shape), memory-mapped, in the order of the episodes.

    Raises:
        DatasetError: the data set cannot be read, or the file beside it is damaged.
    """
    key = hashlib.sha256(f"{encoder.fingerprint} {dataset.sha256}".encode()).hexdigest()[:16]
    path = dataset.folder / f"features-{key}.f16"
    with dataset.open() as file:
        names = named(file["episode_0/observations"], IMAGE)
        if not names:
            raise DatasetError(f"{dataset.folder}: no pictures; generate the data set with `--observation visual`")
        shape = (dataset.steps, len(names), *encoder.shape)
        if not path.is_file():
            with run_bar(quiet) as bar:
                _compute(path, file, names, shape, encoder, bar)
    whole = path.stat().st_size == 2 * math.prod(shape) + seal.LENGTH and seal.is_sealed(path)
    if reason := seal.fault(path) if whole else "not the features of all pictures":
        raise DatasetError(f"{path}: {reason}; remove it, and it is made again")
    rows = np.memmap(path, dtype=np.float16, mode="r", shape=shape)
    return {name: rows[:, number] for number, name in enumerate(names)}


def _compute(
    path: Path, file: Any, names: list[str], shape: tuple[int, ...], encoder: FrozenEncoder, bar: Progress
) -> None:
    """Append the features of one episode after the other to an unfinished file, and name it at the end."""
    unfinished, note = path.with_suffix(".unfinished"), path.with_suffix(".sha256")
    size = 2 * math.prod(shape[1:])  # bytes of a step
    steps, task = 0, bar.add_task("encode pictures", total=shape[0])
    with Lock(path, wait=True), writing(path, unfinished), open(unfinished, "a+b") as out:
        if path.is_file():  # another process has made it meanwhile
            return
        digest, done = _begun(out, note)
        for number in range(len(file)):
            group = file[f"episode_{number}"]
            steps += len(group["actions"])
            if steps * size > done:
                images = [group[f"observations/{name}"][: len(group["actions"])] for name in names]
                features = np.stack([encoder(torch.from_numpy(part)).numpy() for part in images], axis=1).tobytes()
                out.write(features)
                out.flush()
                digest.update(features)
                write_atomically(note, f"{steps * size} {digest.hexdigest()}")
            bar.update(task, completed=steps)
        out.write(seal.line(digest.hexdigest()))
        out.flush()
        unfinished.replace(path)
        note.unlink(missing_ok=True)


def _begun(out: Any, note: Path) -> tuple[Any, int]:
    """Return the sha256 of the whole episodes in an unfinished file, and their bytes; cut off all else.

    What is not as it was noted when it was written begins anew.
    """
    done, wanted = 0, b""
    if note.is_file() and len(words := note.read_bytes().split()) == 2 and words[0].isdigit():
        done, wanted = int(words[0]), words[1]
    out.seek(0)
    digest = hashlib.sha256(out.read(done))
    if digest.hexdigest().encode() != wanted:
        digest, done = hashlib.sha256(), 0
    out.truncate(done)
    return digest, done
