"""Instructions read by rule: networks are told which classes, colours and rooms are named, whatever the words."""

from contextlib import closing
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import trimesh
from gymnasium import spaces

import chmarl_pb
from chmarl_pb import catalog
from chmarl_pb.catalog import BENCHMARK
from chmarl_pb.homes.imports import Wish, add_thing
from chmarl_pb.learning.networks import build_encoder
from chmarl_pb.learning.networks.detections import SHAPE
from chmarl_pb.learning.networks.match import ROOMS, named_by
from chmarl_pb.learning.networks.parsed import Parsed
from chmarl_pb.tasks import language
from chmarl_pb.tasks.splits import load_tasks

CLASSES, COLOURS = len(BENCHMARK.rows) + 1, len(catalog.COLOURS) + 1
MUG, SOFA = BENCHMARK.class_ids["mug"], BENCHMARK.class_ids["sofa"]


def tokens(*texts: str) -> torch.Tensor:
    return torch.from_numpy(np.stack([language.tokenize(text, 24, attributes=True) for text in texts]))


@pytest.mark.parametrize("split", ["val-unseen", "test-unseen", "generated-val"])
def test_each_instruction_names_its_classes(split: str) -> None:
    with closing(chmarl_pb.parallel_env(split=split)) as env:
        tasks = load_tasks(split)[:40]
        seen = [env.reset(options={"task": task})[0]["humanoid"]["instruction"] for task in tasks]
    found = Parsed(CLASSES)(torch.from_numpy(np.stack(seen))).classes
    named = [[BENCHMARK.class_ids[task.graspable], BENCHMARK.class_ids[task.target]] for task in tasks]
    assert found.argmax(dim=2).tolist() == named
    assert (found.sum(dim=2) == 1).all()


def test_what_is_not_named_is_no_class_but_any_colour_and_any_room() -> None:
    bathroom, red = 1 + ROOMS.index(BENCHMARK.class_ids["bathroom"]), catalog.COLOUR_IDS["red"]
    texts = ("Put the red mug on the couch in the washroom.", "Put the mug on the couch.", "Put the mug away.")
    wanted = Parsed(CLASSES, COLOURS)(tokens(*texts))
    assert wanted.classes[:2].argmax(dim=2).tolist() == [[MUG, SOFA]] * 2
    assert not wanted.classes[2].any()
    assert wanted.colours is not None and wanted.rooms is not None
    assert wanted.colours[0, 0].nonzero().tolist() == [[red]]
    assert wanted.colours[1, 0].all()
    assert wanted.rooms.argmax(dim=1).tolist() == [bathroom, 0, 0]


@pytest.mark.parametrize("track", ["paper", "grounded"])
@pytest.mark.parametrize("seen", ["scene_graph", "detections"])
def test_words_alone_change_no_features(track: str, seen: str) -> None:
    with closing(chmarl_pb.parallel_env("scene_graph", split="val-unseen", track=track)) as env:
        space, observation = env.observation_space("humanoid"), env.reset(seed=0)[0]["humanoid"]
    assert isinstance(space, spaces.Dict)
    if seen == "detections":
        kept = {key: box for key, box in space.spaces.items() if not key.startswith(("node_", "edge"))}
        space = spaces.Dict({**kept, "image": spaces.Box(0, 1, SHAPE, np.float16)})
        observation = {**observation, "image": np.random.default_rng(0).random(SHAPE).astype(np.float16)}
    encode = build_encoder(space, 16, "detector", "parsed", numbers_past=True, word_vectors=True)
    features = []
    for text in ("Put the mug on the couch.", "Set the mug onto the sofa please.", "Put the apple on the couch."):
        words = language.tokenize(text, len(observation["instruction"]), attributes=track == "grounded")
        assert (named_by(words)[0] >= 0).all()
        given = {**observation, "instruction": words}
        features.append(encode({key: torch.from_numpy(np.asarray(given[key]))[None] for key in space.spaces}))
    assert torch.equal(features[0], features[1])
    assert not torch.equal(features[0], features[2])


def test_nothing_is_taught() -> None:
    with closing(chmarl_pb.parallel_env()) as env, pytest.raises(ValueError, match=r"nothing to learn.*grounding_coef"):
        build_encoder(env.observation_space("humanoid"), 16, graph_pool="parsed", taught=True)


@pytest.fixture
def parrots(tmp_path: Path) -> Path:
    """A catalogue with one object whose name has a word of its own."""
    trimesh.creation.icosphere(radius=0.04).export(tmp_path / "ball.stl")
    path = tmp_path / "things" / "my_things.toml"
    add_thing(tmp_path / "ball.stl", Wish("parrot"), path)
    return path


@pytest.mark.parametrize(("pool", "taught"), [("parsed", False), ("grounded", True)])
def test_colours_behind_own_words_are_not_misread(parrots: Path, pool: str, taught: bool) -> None:
    with closing(chmarl_pb.parallel_env(catalog=parrots, lookalikes=True)) as env:
        space = env.observation_space("humanoid")
    with pytest.raises(ValueError, match="words of your own among lookalikes"):
        build_encoder(space, 16, graph_pool=pool, taught=taught)


@pytest.mark.parametrize("options", [{"task": "tidy"}, {"catalog": ""}])
def test_what_would_not_be_read_is_refused(parrots: Path, options: dict[str, str]) -> None:
    given: dict[str, Any] = {name: value or parrots for name, value in options.items()}
    with closing(chmarl_pb.parallel_env(**given)) as env:
        space = env.observation_space("humanoid")
    with pytest.raises(ValueError, match=r"graph_pool='parsed' (reads instructions of one object|knows the benchmark)"):
        build_encoder(space, 16, graph_pool="parsed")
    build_encoder(space, 16, graph_pool="grounded")


def test_what_words_mean_is_taught_with_the_benchmarks_catalogue_alone(parrots: Path) -> None:
    with closing(chmarl_pb.parallel_env(task="tidy")) as env:
        build_encoder(env.observation_space("humanoid"), 16, graph_pool="grounded", taught=True)
    with closing(chmarl_pb.parallel_env(catalog=parrots)) as env:
        space = env.observation_space("humanoid")
    with pytest.raises(ValueError, match="grounding_coef teaches what the benchmark's words say"):
        build_encoder(space, 16, graph_pool="grounded", taught=True)
    # Names of own classes may be in the benchmark's words alone.
    with closing(chmarl_pb.parallel_env()) as env:
        space.spaces["instruction"] = env.observation_space("humanoid")["instruction"]
    with pytest.raises(ValueError, match="grounding_coef teaches what the benchmark's words say"):
        build_encoder(space, 16, graph_pool="grounded", taught=True)
