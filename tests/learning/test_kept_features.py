"""Frozen features in the place of pictures: the same for a stored episode, in an environment, and in several."""

from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest
import torch

pytest.importorskip("minari")

from chmarl_pb.data.generate import generate
from chmarl_pb.data.read import Dataset
from chmarl_pb.data.recipe import Recipe
from chmarl_pb.envs.parallel import HouseholdEnv
from chmarl_pb.errors import DatasetError
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.learning.networks.frozen import FrozenEncoder
from chmarl_pb.learning.networks.kept_features import FeatureEnv, feature_space, kept_features, reset_all, step_all
from chmarl_pb.learning.networks.residual import FEATURES
from chmarl_pb.learning.storage.seal import LENGTH
from chmarl_pb.policies.registry import make_policy
from tests.helpers.damage import flipped
from tests.helpers.frozen_weights import random_weights

WEIGHTS = random_weights()
STAY = {"humanoid": 9, "drone": 8}
TURN = {"humanoid": 7, "drone": 4}


@pytest.fixture(scope="module")
def data(tmp_path_factory: pytest.TempPathFactory) -> Dataset:
    """Three episodes."""
    return generate(Recipe("val-unseen", "visual", limit=3), tmp_path_factory.mktemp("data"), workers=1)


@pytest.fixture(scope="module")
def envs() -> Iterator[list[FeatureEnv]]:
    """Two environments side by side."""
    encoder = FrozenEncoder("resnet18", WEIGHTS)
    both = [FeatureEnv(HouseholdEnv(observation="visual", split="val-unseen"), encoder) for _ in range(2)]
    yield both
    for env in both:
        env.close()


def test_features_take_the_place_of_pictures(envs: list[FeatureEnv]) -> None:
    env = envs[0]
    observations, _ = env.reset(seed=1)
    for name in env.possible_agents:
        assert env.observation_space(name).contains(observations[name])
    batch = {key: torch.from_numpy(part)[None] for key, part in observations["drone"].items()}
    assert build_encoder(env.observation_space("drone"), 8, env.encoder.name)(batch).shape == (1, 8)
    assert feature_space(env.env.observation_space("drone"), env.encoder)["image"].dtype == np.float16
    assert env.step(STAY)[0].keys() == observations.keys()


def test_experts_find_the_environment_inside(envs: list[FeatureEnv]) -> None:
    env = envs[0]
    expert = make_policy("search", env)
    observations, infos = env.reset(seed=1)
    expert.reset(1)
    assert expert.act(observations, infos).keys() == set(env.possible_agents) and env.unwrapped is env.env


def test_what_stays_is_encoded_once(envs: list[FeatureEnv]) -> None:
    env = envs[0]
    env.reset(seed=4)
    before = env.encoder.computed
    for _ in range(3):
        env.step(STAY)
    assert env.encoder.computed == before


def test_side_by_side_is_as_one_by_one(envs: list[FeatureEnv]) -> None:
    def features(results: list[tuple[Any, ...]]) -> np.ndarray:
        return np.stack([seen["image"] for result in results for seen in result[0].values()])

    alone: list[list[tuple[Any, ...]]] = [
        [env.reset(seed=seed), env.step(TURN)] for env, seed in zip(envs, (2, 3), strict=True)
    ]
    envs[0].encoder._known.clear()
    together: list[list[tuple[Any, ...]]] = [reset_all(envs, [2, 3], [None, None]), step_all(envs, [TURN, TURN])]
    for one, other in zip(zip(*alone, strict=True), together, strict=True):
        np.testing.assert_array_equal(features(list(one)), features(other))
        np.testing.assert_equal([result[1:] for result in one], [result[1:] for result in other])
    assert step_all([], []) == []
    plain = [env.env for env in envs]
    assert reset_all(plain, [2, 3], [None, None])[0][0]["drone"]["image"].dtype == np.uint8


def test_kept_features_are_those_of_the_environment(data: Dataset, envs: list[FeatureEnv]) -> None:
    kept, env, step = kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True), envs[0], 0
    assert set(kept) == {"humanoid_image", "drone_image"} and kept["drone_image"].shape == (data.steps, FEATURES)
    for task in Recipe("val-unseen", "visual", limit=3).tasks:
        observations, _ = env.reset(seed=task.seed, options={"task": task})
        arrays, _ = data.episode(Recipe("val-unseen", "visual").tasks.index(task))
        assert isinstance(arrays["actions"], np.ndarray)
        for actions in arrays["actions"]:
            for name in env.possible_agents:
                np.testing.assert_array_equal(kept[f"{name}_image"][step], observations[name]["image"])
            observations, *_ = env.step(dict(zip(env.possible_agents, actions.tolist(), strict=True)))
            step += 1
    assert step == data.steps


class Killed(Exception):
    """A process has ended before its time."""


class Mortal(FrozenEncoder):
    """Dies when it is asked for the pictures of one more episode."""

    left = 3

    def __call__(self, images: torch.Tensor) -> torch.Tensor:
        if self.left == 0:
            raise Killed
        self.left -= 1
        return super().__call__(images)


@pytest.mark.parametrize("damaged", [False, True])
def test_interrupted_features_end_with_the_same_bytes(data: Dataset, damaged: bool) -> None:
    kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True)
    (path,) = data.folder.glob("features-*.f16")
    wanted, unfinished = path.read_bytes(), path.with_suffix(".unfinished")
    path.unlink()
    with pytest.raises(Killed):  # in the second episode; one call for each robot
        kept_features(data, Mortal("resnet18", WEIGHTS), quiet=True)
    begun = unfinished.read_bytes()
    assert wanted.startswith(begun)
    unfinished.write_bytes((b"?" + begun[1:] if damaged else begun) + b"half a step")
    again = FrozenEncoder("resnet18", WEIGHTS)
    kept_features(data, again, quiet=True)
    left = len(wanted) - LENGTH - (0 if damaged else len(begun))
    assert path.read_bytes() == wanted and again.asked == left // (2 * FEATURES)
    assert [file.name for file in data.folder.glob("features-*")] == [path.name]


def test_features_that_have_changed_are_refused(data: Dataset) -> None:
    kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True)
    (path,) = data.folder.glob("features-*.f16")
    whole = path.read_bytes()
    for place in (0, 1, len(whole) // 2, len(whole) - LENGTH - 1, len(whole) - LENGTH, len(whole) - 5, len(whole) - 1):
        path.write_bytes(flipped(whole, place))
        with pytest.raises(DatasetError, match=rf"{path.name}: .*remove it"):
            kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True)
    path.unlink()


def test_several_processes_make_them_once(data: Dataset) -> None:
    wanted = kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True)
    (path,) = data.folder.glob("features-*.f16")
    whole = path.read_bytes()
    path.unlink()
    encoders = [FrozenEncoder("resnet18", WEIGHTS) for _ in range(2)]
    with ThreadPoolExecutor() as pool:  # each opens the file by itself, as processes do
        found = list(pool.map(lambda encoder: kept_features(data, encoder, quiet=True), encoders))
    assert path.read_bytes() == whole and sum(encoder.asked for encoder in encoders) == 2 * data.steps
    assert all(np.array_equal(one[key], wanted[key]) for one in found for key in wanted)


def test_features_of_the_wrong_size_are_refused(data: Dataset) -> None:
    kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True)
    (path,) = data.folder.glob("features-*.f16")
    path.write_bytes(path.read_bytes() * 2)
    with pytest.raises(DatasetError, match="remove it"):
        kept_features(data, FrozenEncoder("resnet18", WEIGHTS), quiet=True)
    path.unlink()
